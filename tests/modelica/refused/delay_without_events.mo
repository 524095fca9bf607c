model M
  Real x;
equation
  x = noEvent(delay(time, 0.5));  // error: 'delay' and 'spatialDistribution' can only stand in equations
end M;
