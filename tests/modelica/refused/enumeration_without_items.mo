model M
  type Colour = enumeration(:);  // error: the enumeration 'Colour' needs a list
  Integer n = 1;
equation
end M;
