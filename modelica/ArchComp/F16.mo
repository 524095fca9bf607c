within ArchComp;
model F16 "F-16 with a ground-collision-avoidance autopilot: starts in a dive at
2338 ft with the attitude (roll, pitch, yaw), rolls its wings level, then pulls up
at 5 g; altitude is in feet above the ground, and negative altitude is a crash"
  extends F16Flight;
  extends F16Guidance;
equation
  seenAltitude = altitude;
  seenPath = theta - alpha;
  seenRoll = phi;
  seenRollRate = p;
  NzRef = loadRequest;
  psRef = rateRequest;
  annotation(
    experiment(StopTime = 15, Interval = 0.03333333333333333, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 1 / 120));
end F16;
