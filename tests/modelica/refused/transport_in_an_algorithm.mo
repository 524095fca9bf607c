model M
  Real out;
algorithm
  (, out) := spatialDistribution(time, 0, time, true);  // error: 'spatialDistribution'
end M;
