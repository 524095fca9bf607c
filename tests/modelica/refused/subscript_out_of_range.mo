model M
  Real x[2];
equation
  x[1] = 1;
  x[3] = 2;  // error: outside 1..2
end M;
