within Features;
model Starts "Initial equations and start values bound to parameters"
  parameter Real p = 2;
  parameter Real q = p + 1;
  Real x(start = q);
  Real y;
  output Real sum;
  discrete Real d(start = 5);
  Integer mode;
  Boolean first(start = false);
initial equation
  y = p * x;
  mode = integer(p) + 1;
equation
  der(x) = 0;
  der(y) = 1;
  sum = x + y + d;
  when {initial(), time > 0.5} then
    d = pre(d) + 1;
    first = initial();
  end when;
  when time > 0.75 then
    mode = pre(mode) + 10;
  end when;
  annotation(experiment(StopTime = 1));
end Starts;
