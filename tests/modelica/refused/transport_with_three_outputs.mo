model M
  Real out;
equation
  (, out, ) = spatialDistribution(time, 0, time, true);  // error: has 2 outputs, not 3
end M;
