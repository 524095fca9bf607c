model M
  function f
    input Real u;
    output Real y;
  algorithm
    assert(u < 1, "late", level = AssertionLevel.warning);  // error: 'assert' expects a condition and a literal
    y := u;
  end f;
  Real x = f(time);
equation
end M;
