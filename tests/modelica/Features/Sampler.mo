within Features;
model Sampler "Integral of a sampled input; the sample itself is not an output"
  input Real u(start = 0);
  output Real x(start = 0);
  discrete Real s(start = 0);
equation
  der(x) = s;
  when sample(0, 0.1) then
    s = u;
  end when;
  annotation(experiment(StopTime = 1));
end Sampler;
