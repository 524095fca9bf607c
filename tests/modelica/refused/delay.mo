model M
  Real x;
equation
  x = delay(time, 1);  // error: 'delay' is not supported
end M;
