within Features;
model Algebra "Equations in any order that have to be turned round"
  output Real a;
  output Real b;
  output Real c;
  output Real d;
  output Real f;
  output Boolean late;
  output Integer n;
equation
  2 * b = a + 1;
  c - b = 3;
  10 / d = c;
  a = time;
  -f / 4 + d = 1;
  late = not (a < 0.55) and true;
  n = if late then 7 else -7;
  annotation(experiment(StopTime = 1));
end Algebra;
