within ArchComp;
model F16Autopilot "Ground-collision-avoidance autopilot of an F-16, as a component of its own: rolls the wings level, then
pulls up at 5 g, then stands by; it changes its mode 30 times a second, and its requests follow the aircraft at once"
  extends F16Guidance;
  input Real altitude(unit = "ft", min = -1e6, max = 1e6, start = 0) "Altitude above the ground";
  input Real alpha(unit = "rad", min = -1e3, max = 1e3, start = 0) "Angle of attack";
  input Real phi(unit = "rad", min = -1e3, max = 1e3, start = 0) "Roll angle";
  input Real theta(unit = "rad", min = -1e3, max = 1e3, start = 0) "Pitch angle";
  input Real p(unit = "rad/s", min = -1e3, max = 1e3, start = 0) "Roll rate";
  output Real NzRequest(unit = "1") "Load factor requested of the inner control loop, above the 1 g of level flight";
  output Real psRequest(unit = "rad/s") "Stability roll rate requested of the inner control loop";
equation
  seenAltitude = altitude;
  seenPath = theta - alpha;
  seenRoll = phi;
  seenRollRate = p;
  NzRequest = loadRequest;
  psRequest = rateRequest;
  // A tick at the end of a step sees the state of that time; repeated in the next step, it would see a later one.
  annotation(
    experiment(StopTime = 15, Interval = 0.03333333333333333, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 1 / 120, repeatTicks = "never"));
end F16Autopilot;
