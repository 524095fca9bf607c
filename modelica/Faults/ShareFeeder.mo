within Faults;
model ShareFeeder "Feeder of two charge points, with the temperature of its cable. At the rated current the temperature
settles at 1; it follows the square of the load with a time constant"
  input Real left(unit = "A", min = 0, max = 100, start = 0) "Current of one charge point";
  input Real right(unit = "A", min = 0, max = 100, start = 0) "Current of the other charge point";
  output Real load(unit = "A", min = 0, max = 200) "Total current";
  output Real heat(unit = "1", start = 0.5, fixed = true, min = 0) "Temperature rise, as a share of the rise at the rated current";
  parameter Real rated(unit = "A", min = 1) = 100 "Rated current";
  parameter Real warming(unit = "s", min = 0.01) = 2 "Time constant of the temperature";
equation
  load = left + right;
  der(heat) = ((load / rated) ^ 2 - heat) / warming;
  annotation(experiment(StopTime = 20, Interval = 0.1, Tolerance = 1e-6));
end ShareFeeder;
