model M
  type Colour = enumeration(red, green);
  Colour c = Colour.blue;  // error: 'Colour' has no item 'blue'; it has red, green
equation
end M;
