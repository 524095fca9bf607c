model M
  Real x;
initial equation
  x = delay(time, 0.5);  // error: 'delay' and 'spatialDistribution' are only allowed in equations
equation
  der(x) = 1;
end M;
