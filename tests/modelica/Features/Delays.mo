within Features;
model Delays "delay with a constant and a varying delay time; the delayed signals have kinks and jumps"
  input Real u(start = 1) "Held by co-simulation";
  parameter Real T = 0.3 "Delay time";
  parameter Real longest = 0.5 "Longest delay time that can be remembered";
  parameter Real stretch = 1 "Factor of the varying delay time";
  output Real x(start = 1, fixed = true) "Solution of a delay differential equation";
  output Real late "The input, later";
  output Real ramp "Kink at T";
  output Real steps "A sampled signal, later";
  output Real varying "Time as it was some time ago, which varies";
  output Integer crossings(start = 0) "How often the delayed time has passed 0.255";
protected
  Real way(start = 0, fixed = true);
  Integer count(start = 0);
equation
  der(x) = -delay(x, T);
  late = delay(u, T);
  ramp = delay(time, T);
  when sample(0.1, 0.1) then
    count = pre(count) + 1;
  end when;
  steps = delay(count, T);
  der(way) = 1;
  varying = delay(way, stretch * longest * (0.6 + 0.4 * cos(3 * time)), longest);
  when ramp > 0.255 then
    crossings = pre(crossings) + 1;
  end when;
  annotation(experiment(StopTime = 2, Interval = 0.01, Tolerance = 1e-8), __falsifier_solver(maxStep = 0.002));
end Delays;
