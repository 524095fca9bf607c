within Features;
model Chatter "Slides along a switching surface: events without end"
  output Real x(start = 0.5, fixed = true);
  Boolean up(start = false);
equation
  up = x < 0;
  der(x) = if up then 1 else -1;
  annotation(experiment(StopTime = 1));
end Chatter;
