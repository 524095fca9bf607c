model M
  parameter Integer n = 60000 * 60000;  // error: 3600000000 is too large
end M;
