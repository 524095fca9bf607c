within ArchComp;
model AT "Car with an engine, a torque converter and a four-speed automatic transmission: the driver's throttle and
brake determine engine speed, vehicle speed and gear; a shift schedule selects the gear every 0.04 s"
  extends ATPowertrain;
  extends ATSchedule;
equation
  seenThrottle = throttle;
  seenSpeed = speed;
  ratio = gearRatio[gear];
  annotation(
    experiment(StartTime = 0, StopTime = 50, Interval = 0.01, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.01));
end AT;
