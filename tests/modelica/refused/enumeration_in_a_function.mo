model M
  type Colour = enumeration(red, green);
  function f
    input Colour c;  // error: type 'Colour' is not supported
    output Real y;
  algorithm
    y := 1;
  end f;
  Real x = f(Colour.red);
equation
end M;
