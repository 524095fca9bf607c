within Features;
model Times "Time events, whole parts and remainders"
  parameter Real t1 = 0.35;
  output Real early(start = 0);
  output Real stairs(start = 0);
  output Real saw(start = 0);
  output Integer whole;
  output Real smoothed;
equation
  der(early) = if time < t1 then 1 elseif time <= 2 * t1 then 10 else 100;
  whole = integer(4 * time);
  der(stairs) = whole + floor(-time);
  der(saw) = mod(time, 0.3);
  smoothed = smooth(0, if time < 0.5 then 0 else time - 0.5) + noEvent(abs(sign(time - 2)));
  annotation(experiment(StopTime = 1), __falsifier_solver(method = "fixed", step = 0.05));
end Times;
