model M
  function f
    output Real y;
    external "C";  // error: external
  end f;
  Real x = f();
equation
end M;
