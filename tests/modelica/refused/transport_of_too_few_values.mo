model M
  Real out;
equation
  (, out) = spatialDistribution(time, 0, time, true, {0, 0.5, 1}, {1, 2});  // error: expected size [3], found [2]
end M;
