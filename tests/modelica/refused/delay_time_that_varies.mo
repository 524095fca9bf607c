model M
  Real x;
equation
  x = delay(time, 1 + time);  // error: without 'delayMax' needs to be a parameter
end M;
