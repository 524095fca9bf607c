within Faults;
model ShareCharger "Charge point that shares a feeder with another one. At each tick it takes what the car requests, as far
as the other charge point leaves it. It publishes its current on a bus, whose messages carry the value of the previous tick"
  input Real request(unit = "A", min = 0, max = 80, start = 0) "Current that the car requests";
  input Real other(unit = "A", min = 0, max = 100, start = 0) "Current that the other charge point has published";
  output Real current(unit = "A", start = 0, fixed = true, nominal = 10, min = 0) "Current to the car";
  output Real published(unit = "A", start = 0, fixed = true, nominal = 10, min = 0) "Current as told to the other charge point";
  parameter Real period(unit = "s", min = 0.001) = 0.1 "Sample time of the controller";
  parameter Real limit(unit = "A", min = 0) = 100 "Current that the feeder allows for both";
  parameter Real startAfter(unit = "s", min = 0) = 0 "Time before which no current flows, so that not both start at once";
protected
  Integer ticks(start = 0, fixed = true) "Ticks since the start";
equation
  when sample(0, period) then
    ticks = pre(ticks) + 1;
    published = pre(current);
    // Correct for what the other has published; what it has decided since is not known here.
    current = if ticks * period <= startAfter then 0 else max(0, min(request, limit - other));
  end when;
  annotation(
    experiment(StopTime = 20, Interval = 0.1, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.1, repeatTicks = "never"));
end ShareCharger;
