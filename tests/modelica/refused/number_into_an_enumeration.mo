model M
  type Colour = enumeration(red, green);
  Colour c(start = 2);  // error: expected M.Colour, found Integer
equation
  when time > 1 then
    c = Colour.green;
  end when;
end M;
