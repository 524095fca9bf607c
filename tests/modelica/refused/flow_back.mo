model M
  Real way(start = 0);
  Real out;
equation
  der(way) = cos(time);
  (, out) = spatialDistribution(time, 0, way, der(way) > 0);  // error: positiveVelocity = true
end M;
