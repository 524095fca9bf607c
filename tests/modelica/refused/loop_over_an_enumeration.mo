model M
  type Colour = enumeration(red, green);
  Real x[2];
equation
  for c in Colour loop  // error: 'Colour'
    x[c] = 1;
  end for;
end M;
