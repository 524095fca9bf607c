model M
  type Colour = enumeration(:);  // error: the enumeration 'Colour' must list
  Integer n = 1;
equation
end M;
