model M
  type Colour = enumeration(red, green);
  type Shape = enumeration(round, square);
  Colour c;
equation
  c = Shape.round;  // error: between M.Colour and M.Shape
end M;
