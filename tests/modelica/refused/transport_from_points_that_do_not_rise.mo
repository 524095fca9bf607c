model M
  Real out;
equation
  (, out) = spatialDistribution(time, 0, time, true, {0, 0.6, 0.5, 1}, {1, 2, 3, 4});  // error: rise from 0 to 1
end M;
