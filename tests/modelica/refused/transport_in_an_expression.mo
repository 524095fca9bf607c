model M
  Real out;
equation
  out = 2 * spatialDistribution(time, 0, time, true);  // error: 'spatialDistribution' can only stand in
end M;
