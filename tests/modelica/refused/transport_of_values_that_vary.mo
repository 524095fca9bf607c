model M
  Real out;
equation
  (, out) = spatialDistribution(time, 0, time, true, {0, 1}, {1, time});  // error: 'initialValues'
end M;
