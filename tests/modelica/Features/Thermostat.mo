within Features;
model Thermostat "Two-point control: a triangle between 1 and 2 with slopes 1 and -3, switched by located events"
  output Real x(start = 1.5, fixed = true);
  output Boolean heating(start = true);
  output Integer switches(start = 0);
equation
  der(x) = if heating then 1 else -3;
  when x >= 2 then
    heating = false;
    switches = pre(switches) + 1;
  elsewhen x <= 1 then
    heating = true;
    switches = pre(switches) + 1;
  end when;
  annotation(experiment(StopTime = 20, Tolerance = 1e-6));
end Thermostat;
