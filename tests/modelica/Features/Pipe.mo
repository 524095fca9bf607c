within Features;
model Pipe "Transport through a pipe whose speed varies: what comes in leaves it when the way is 1"
  input Real u(start = 0) "Comes in after the start";
  parameter Real speed = 2;
  output Real way(start = 2, fixed = true) "How far the medium has come";
  output Real inlet "The same as the input";
  output Real outlet;
  output Real smooth "The outlet of a second pipe, which gets a smooth signal";
equation
  der(way) = speed + sin(time);
  (inlet, outlet) = spatialDistribution(u, 0, way, true, initialPoints = {0, 0.5, 1}, initialValues = {1, 5, 7});
  (, smooth) = spatialDistribution(in0 = cos(time), in1 = 0, x = way, positiveVelocity = true);
  annotation(experiment(StopTime = 3, Interval = 0.01, Tolerance = 1e-6), __falsifier_solver(maxStep = 0.005, delayPoints = 150));
end Pipe;
