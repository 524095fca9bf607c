model Inverter "Island inverter: a controlled bridge feeds a load through a filter of a coil and a capacitor. The current loop saturates;
the protection stops the bridge for some time when the current is too large, and locks it after three stops within a second. All
times are ten times longer than in a real one"
  input Real load(unit = "A", min = -8, max = 8, start = 0) "Current that the load takes";
  input Real wanted(unit = "V", min = 20, max = 60, start = 40) "Wanted voltage";
  output Real voltage(unit = "V", start = 40, fixed = true, nominal = 10) "Voltage at the load";
  output Real current(unit = "A", start = 0, fixed = true, nominal = 10) "Current in the coil";
  output Boolean stopped(start = false, fixed = true) "The protection has stopped the bridge";
  output Integer stops(start = 0, fixed = true, min = 0) "Stops within the last second or so; three lock the bridge";
  output Boolean locked(start = false, fixed = true) "The bridge is locked";
  parameter Real coil(unit = "H", min = 0.01) = 0.05 "Inductance of the coil";
  parameter Real capacitor(unit = "F", min = 1e-6) = 0.008 "Capacitance";
  parameter Real supply(unit = "V", min = 1) = 70 "Voltage of the supply, which limits the bridge";
  parameter Real largest(unit = "A", min = 0) = 17 "Current at which the protection acts";
  parameter Real rest(unit = "s", min = 0) = 0.1 "Time of a stop";
protected
  Real sum(start = 40, fixed = true) "Integral term";
  Real bridge "Voltage of the bridge";
  Integer ticks(start = 0, fixed = true) "Ticks that a stop still lasts";
  Integer forget(start = 0, fixed = true) "Ticks until one stop is forgotten";
equation
  bridge = if stopped or locked then 0 else max(-supply, min(supply, sum + 0.4 * (wanted - voltage) - 1.0 * (current - load)));
  der(current) = (bridge - voltage - 0.3 * current) / coil;
  der(voltage) = (current - load) / capacitor;
  // The fault: the integral goes on while the bridge is saturated or stopped.
  der(sum) = 3 * (wanted - voltage);
  when sample(0, 0.005) then
    ticks = if abs(current) > largest and pre(ticks) == 0 and not pre(stopped) then integer(rest / 0.005)
      else max(0, pre(ticks) - 1);
    stopped = ticks > 0;
    forget = if stopped and not pre(stopped) then 240 else max(0, pre(forget) - 1);
    stops = if stopped and not pre(stopped) then pre(stops) + 1 elseif forget == 0 then 0 else pre(stops);
    locked = pre(locked) or stops >= 3;
  end when;
  annotation(
    experiment(StopTime = 4, Interval = 0.005, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.0025, repeatTicks = "always"));
end Inverter;
