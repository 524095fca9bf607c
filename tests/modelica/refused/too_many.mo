model M
  Real x;
equation
  x = 1;
  x = 2;  // error: one equation too many
end M;
