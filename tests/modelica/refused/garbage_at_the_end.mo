model M
  Real x;
equation
  x = 1;
end M;
modl N  // error: syntax error
end M;
