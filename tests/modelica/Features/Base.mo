within Features;
partial model Base
  parameter Real gain = 1 "Gain";
  Real x(start = 1, fixed = true);
equation
  der(x) = -gain * x;
end Base;
