within Features;
model Arrays "Array equations, loops over equations, arrays of components"
  model Tank "First-order lag"
    parameter Real T = 1;
    input Real u;
    output Real y(start = 0);
  equation
    T * der(y) = u - y;
  end Tank;

  parameter Integer n = 3;
  parameter Real A[2, 2] = [0, 1; -1, 0];
  Real x[2](start = {1, 0}, each fixed = true);
  output Real v[n];
  output Real total;
  output Real last;
  output Real both;
  output Real history[4](start = {0, 0, 0, 0});
  Tank tank[n](T = {1, 2, 4});
  output Real slow = tank[3].y;
equation
  der(x) = A * x;
  for i in 1:n loop
    v[i] = i * x[1] + (if i == 2 then 1 else 0);
    tank[i].u = i;
  end for;
  total = sum(v[1:2]) + sum(tank.y);
  last = v[end];
  both = x * x;
algorithm
  when sample(0.1, 0.1) then
    history[2:4] := pre(history[1:3]);
    for i in 1:1 loop
      history[i] := time;
    end for;
  end when;
  annotation(experiment(StopTime = 1, Tolerance = 1e-9));
end Arrays;
