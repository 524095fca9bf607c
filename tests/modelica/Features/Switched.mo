within Features;
model Switched "if-equations, Boolean and Integer inputs, an assertion"
  input Boolean on(start = false);
  input Integer level(start = 1, min = 0, max = 3);
  parameter Boolean fancy = true;
  output Real x(start = 0);
  output Real y;
  output Integer changes(start = 0);
equation
  if on then
    der(x) = level;
    y = 2 * x;
  elseif level > 2 then
    der(x) = 100;
    y = -1;
  else
    der(x) = 0;
    y = x;
  end if;
  when change(level) then
    changes = pre(changes) + 1;
  end when;
  assert(x < 10, "x has left its range");
  annotation(experiment(StopTime = 1));
end Switched;
