within Features;
model Ball "Bouncing ball that rests when it is slow"
  parameter Real e(min = 0, max = 1) = 0.7 "Restitution";
  output Real h(start = 1, fixed = true, unit = "m") "Height";
  output Integer bounces(start = 0) "Number of bounces";
  Speed v(start = 0, fixed = true);
  Boolean flying(start = true);
equation
  der(h) = v;
  der(v) = if flying then -gravity else 0;
  when h <= 0 then
    bounces = pre(bounces) + 1;
    flying = bounces < 12;
    reinit(v, if flying then -e * pre(v) else 0);
  end when;
  annotation(experiment(StopTime = 5, Tolerance = 1e-8));
end Ball;
