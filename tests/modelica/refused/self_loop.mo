model M
  Real x;
equation
  x = 0.5 * x + sin(x);  // error: cannot be solved
end M;
