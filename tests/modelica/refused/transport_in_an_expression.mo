model M
  Real out;
equation
  out = 2 * spatialDistribution(time, 0, time, true);  // error: 'spatialDistribution' is only allowed in
end M;
