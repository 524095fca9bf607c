within ArchComp;
model CCLeader "The leading one of the chasing cars, as a component of its own: throttle and brake push it towards negative
y and damp its speed"
  input Real throttle(start = 0, min = 0, max = 1, unit = "1") "Throttle: pushes the car towards negative y";
  input Real brake(start = 0, min = 0, max = 1, unit = "1") "Brake: damps the speed";
  output Real y(unit = "m", start = 0, fixed = true) "Position of the car";
  Real v(unit = "m/s", start = 0, fixed = true) "Velocity of the car, negative when it drives forward";
equation
  der(y) = v;
  der(v) = -throttle - brake * v;
  annotation(
    experiment(StopTime = 100, Interval = 0.01, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.01));
end CCLeader;
