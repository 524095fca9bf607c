model M
  type Colour = enumeration(red, green);
  Real x[2] = {1, 2};
  Real y = x[Colour.red];  // error: subscripts must be Integers
equation
end M;
