within ArchComp;
model ATShift "Shift logic of a four-speed automatic transmission, as a component of its own: every 0.04 s it compares throttle
and speed with a schedule, and shifts by one gear once a threshold has stayed crossed"
  extends ATSchedule;
  input Real throttle(unit = "%", min = 0, max = 100, start = 0) "Throttle opening: 0 closed, 100 fully open";
  input Real speed(unit = "mph", min = -10, max = 250, start = 0) "Vehicle speed";
equation
  seenThrottle = throttle;
  seenSpeed = speed;
  // A tick at the end of a step sees the speed of that time; repeated in the next step, it would see a later one.
  annotation(
    experiment(StartTime = 0, StopTime = 50, Interval = 0.04, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.04, repeatTicks = "never"));
end ATShift;
