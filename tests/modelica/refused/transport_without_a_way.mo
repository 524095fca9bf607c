model M
  Real out;
equation
  (, out) = spatialDistribution(time, 0, positiveVelocity = true);  // error: the argument 'x' of
end M;
