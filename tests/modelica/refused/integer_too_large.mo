model M
  parameter Integer n = 3000000000;  // error: too large
end M;
