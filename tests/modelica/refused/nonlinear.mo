model M
  Real x;
equation
  x ^ 3 = 2;  // error: cannot be solved
end M;
