model M
  Real x;
equation
  connect(x, x);  // error: connect
end M;
