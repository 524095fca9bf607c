within Features;
model SeenSampler "The same with an output that every tick changes: what has been read stays"
  extends Sampler;
  output Integer seen(start = 0);
equation
  when sample(0, 0.1) then
    seen = pre(seen) + 1;
  end when;
  annotation(experiment(StopTime = 1));
end SeenSampler;
