model M
  Real x if true;  // error: conditional components
equation
  x = 1;
end M;
