model M
  type Colour = enumeration(red, green);
  Colour c = Colour.red;
  Boolean b = c == 1;  // error: compares M.Colour with Integer
equation
end M;
