model M
  Real x;
  Real y;  // error: no equation for y
equation
  x = 1;
end M;
