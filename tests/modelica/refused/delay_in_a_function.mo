model M
  function f
    input Real u;
    output Real y;
  algorithm
    y := delay(u, 1);  // error: 'delay' is not supported in functions
  end f;
  Real x = f(time);
equation
end M;
