model M
  function f
    input Real a;
    output Real y;
  algorithm
    y := a;
  end f;
  Real x;
equation
  x = f();  // error: argument 'a' of 'f' is missing
end M;
