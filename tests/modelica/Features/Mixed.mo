within Features;
model Mixed "An algorithm section with continuous and sampled parts"
  output Real smooth;
  output Real kept(start = -1);
  output Real twice;
equation
  twice = 2 * kept + 0 * smooth;
algorithm
  smooth := time;
  smooth := smooth + 1;
  when sample(0.5, 0.5) then
    kept := smooth;
  elsewhen time > 0.7 then
    kept := pre(kept) + 10;
  end when;
  annotation(experiment(StopTime = 1));
end Mixed;
