model M
  Real x;
  Real y;
equation
  x = y + 1;
  y = x * 2;  // error: algebraic loop
end M;
