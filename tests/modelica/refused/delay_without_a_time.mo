model M
  Real x = delay(time);  // error: 'delay' expects 2 or 3 arguments
equation
end M;
