within Features;
model Corners "Empty ranges, results assigned to arguments, defaults, values before an event"
  function twice
    input Real x[:];
    output Real y[size(x, 1)];
  algorithm
    for k in 1:size(x, 1) loop
      y[k] := 2 * x[k];
    end for;
  end twice;

  function plus
    constant Real k = 3;
    input Real a;
    input Real unused = 0;
    input Real b = k;
    output Real c;
  algorithm
    c := a + b;
  end plus;

  function composed
    input Real a;
    output Real y;
  protected
    Real k = 100;
    Real x[2];
  algorithm
    x := {a, a + 1};
    x := twice(x);
    y := plus(x[1]) + k * x[2];
  end composed;

  function unequal
    input Integer n;
    output Real y;
  protected
    Real x[n];
    Real two[2];
  algorithm
    two := twice(x);
    y := two[1];
  end unequal;

  parameter Integer n = 1;
  parameter Integer m = 2;
  parameter Real late(unit = "s") = 0.8;
  output Integer passed(start = 0);
  output Integer loops;
  output Real own[2];
  output Real value = composed(1);
  output Real fits = unequal(m);
  output Real x(start = 0, unit = "K", displayUnit = "degC");
  output Real y = 2 * x;
  output Real atState(start = -1), atTick(start = -1);
equation
  der(x) = 1;
  when x > 0.55 then
    atState = pre(y);
  end when;
  when sample(0, 0.2) then
    atTick = pre(y);
  end when;
  when time >= late then
    passed = pre(passed) + 1;
  end when;
algorithm
  loops := size(own[2:1], 1);
  for i in 1:n - 1 loop
    loops := loops + 100;
  end for;
algorithm
  own := {1, 2};
  own := twice(own);
  annotation(experiment(StopTime = 1));
end Corners;
