model M
  type Colour = enumeration(red, green);
  Colour c = Colour.red;
  Integer n = c + 1;  // error: '+' expects numbers, not M.Colour
equation
end M;
