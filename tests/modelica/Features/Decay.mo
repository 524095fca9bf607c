within Features;
model Decay "Exponential decay"
  input Real u(start = 0, min = -1, max = 1) "Inflow";
  parameter Real k(unit = "1/s", min = 0) = 2 "Rate";
  parameter Real x0 = 3 "Start";
  parameter Real twice = 2 * k "Calculated";
  output Real y "Twice the state";
  Real x(start = x0, fixed = true, unit = "m") "State";
equation
  der(x) = -k * x + u;
  y = twice / k * x;
  annotation(experiment(StopTime = 1, Tolerance = 1e-10));
end Decay;
