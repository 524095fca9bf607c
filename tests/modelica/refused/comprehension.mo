model M
  Real x[3];
equation
  x = {i for i in 1:3};  // error: 'for'
end M;
