model ChlorineDosing "Dosing of chlorine into drinking water. A pump is switched on and off with a hysteresis, by a probe behind a long
pipe that sees the water late. It also runs in peak hours, when much water is consumed. When there is too little
chlorine, an alarm makes the pump run at its full rate for a fixed time. Very dirty water goes through a filter first"
  input Real consumed(unit = "m3/h", min = 2, max = 20, start = 8) "Flow of water to the consumers";
  input Real dirt(unit = "mg/l", min = 0, max = 1, start = 0.3) "Chlorine that the incoming water uses up";
  output Real chlorine(unit = "mg/l", start = 0.5, fixed = true, min = 0) "Chlorine in the tank";
  output Real probe(unit = "mg/l", min = 0) "Chlorine that the probe measures";
  output Boolean dosing(start = false, fixed = true) "The pump is on";
  output Boolean shock(start = false, fixed = true) "The pump runs at its full rate";
  output Integer alarms(start = 0, fixed = true, min = 0) "Number of alarms";
  parameter Real low(unit = "mg/l", min = 0) = 0.4 "Below this the pump is switched on";
  parameter Real high(unit = "mg/l", min = 0) = 0.6 "Above this the pump is switched off";
  parameter Real alarming(unit = "mg/l", min = 0) = 0.23 "Below this the alarm is raised";
  parameter Real shocking(unit = "s", min = 0) = 90 "Time for which the pump runs at its full rate";
  parameter Real peak(unit = "m3/h", min = 0) = 16 "Flow above which it is a peak hour";
  parameter Real filtered(unit = "mg/l", min = 0) = 0.9 "Dirt above which the water is filtered";
  parameter Real pipe(unit = "s", min = 1) = 40 "Time that the water takes to the probe";
protected
  Integer ticks(start = 0, fixed = true) "Seconds for which the full rate still lasts";
equation
  der(chlorine) = (if shock then 0.02 elseif dosing then 0.009 else 0) - consumed / 20 * (0.004 * (if dirt > filtered then 0.1 else dirt) + 0.006 * chlorine);
  probe = delay(chlorine, pipe);
  when sample(0, 1) then
    dosing = consumed > peak or probe < low or pre(dosing) and probe < high;
    alarms = if probe < alarming and pre(ticks) == 0 and not pre(shock) then pre(alarms) + 1 else pre(alarms);
    // The fault: the full rate does not end early, however much chlorine there is.
    ticks = if alarms > pre(alarms) then integer(shocking) else max(0, pre(ticks) - 1);
    shock = ticks > 0;
  end when;
  annotation(
    experiment(StopTime = 1000, Interval = 1, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.5, repeatTicks = "always"));
end ChlorineDosing;
