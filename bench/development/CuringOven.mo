model CuringOven "Oven with a thermostat, for 1000 s of a batch. The heater has a hysteresis and a minimum pause, a limiter cuts
it off when the air is too hot until it has cooled down, and an open door stops the heater and cools the air. The parts heat up
slowly in the air"
  input Real wanted(unit = "degC", min = 100, max = 200, start = 150) "Set point of the air";
  input Boolean door(start = false) "The door is open";
  output Real air(unit = "degC", start = 25, fixed = true, nominal = 100) "Temperature of the air";
  output Real parts(unit = "degC", start = 25, fixed = true, nominal = 100) "Temperature of the parts";
  output Boolean heating(start = false, fixed = true) "The heater is on";
  output Boolean limited(start = false, fixed = true) "The limiter has cut off the heater";
  output Integer starts(start = 0, fixed = true, min = 0) "Number of times that the heater was switched on";
  output Integer cuts(start = 0, fixed = true, min = 0) "Number of times that the limiter has acted";
  parameter Real period(unit = "s", min = 0.1) = 1 "Sample time of the controller";
  parameter Real band(unit = "K", min = 0) = 4 "Half of the thermostat's hysteresis";
  parameter Real pause(unit = "s", min = 0) = 15 "Minimum time between switching off and on";
  parameter Real hottest(unit = "degC") = 220 "Air temperature at which the limiter acts";
  parameter Real cooled(unit = "degC") = 90 "Air temperature below which the limiter releases the heater";
protected
  Real coil(unit = "degC", start = 25, fixed = true, nominal = 100) "Temperature of the heater's coil";
  Integer off(start = 100, fixed = true) "Ticks since the heater was switched off";
  Boolean call(start = false, fixed = true) "The thermostat calls for heat";
equation
  der(coil) = (if heating then 9 else 0) - (coil - air) / 60;
  der(air) = (coil - air) / 110 - (air - parts) / 60 - (air - 25) / (if door then 60 else 900);
  der(parts) = (air - parts) / 400;
  when sample(0, period) then
    call = air < wanted - band or pre(call) and air < wanted + band;
    limited = air > hottest or pre(limited) and air > cooled;
    // The fault: an open door stops the heater at once, but closing it skips the minimum pause.
    off = if pre(heating) then 0 elseif door then 100 else pre(off) + 1;
    heating = call and not limited and not door and (pre(heating) or off * period >= pause);
    starts = if heating and not pre(heating) then pre(starts) + 1 else pre(starts);
    cuts = if limited and not pre(limited) then pre(cuts) + 1 else pre(cuts);
  end when;
  annotation(
    experiment(StopTime = 1000, Interval = 1, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.5, repeatTicks = "always"));
end CuringOven;
