model M
  Real x;
equation
  x = delay(time, 1 + time);  // error: without 'delayMax' must be a parameter
end M;
