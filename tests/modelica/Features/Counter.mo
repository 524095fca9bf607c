within Features;
model Counter "Sampled counters with different times"
  parameter Real period = 1 / 30;
  output Integer ticks(start = 0);
  output Integer late(start = 10);
  discrete output Real held(start = -1);
  output Integer odd;
equation
  when sample(0, period) then
    ticks = pre(ticks) + 1;
    held = time;
  end when;
  when sample(0.25, 0.5) then
    late = pre(late) - 1;
  end when;
  odd = mod(ticks, 2);
  annotation(experiment(StopTime = 2));
end Counter;
