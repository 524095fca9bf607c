model M
  Real out;
equation
  (, out) = spatialDistribution(time, 0, time, true, length = 2);  // error: has no argument 'length'
end M;
