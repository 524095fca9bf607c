model M
  Real x;
equation
  x = noEvent(delay(time, 0.5));  // error: 'delay' and 'spatialDistribution' are only allowed in equations
end M;
