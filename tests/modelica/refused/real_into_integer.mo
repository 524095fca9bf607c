model M
  Integer n;
equation
  n = 2.5 * time;  // error: integer(...)
end M;
