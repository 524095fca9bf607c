model M
  function f
    input Real a[2];
    output Real y;
  algorithm
    y := sum(a * 2);  // error: use a loop
  end f;
  Real x;
equation
  x = f({1, 2});
end M;
