model M
  parameter Real p = delay(1.0, 0.5);  // error: 'delay' and 'spatialDistribution' are only allowed in equations
equation
end M;
