model M
  Real x;
equation
  x = delay(time, 1 + time, 2 + time);  // error: 'delayMax' must be a parameter
end M;
