model M
  type Colour = enumeration(red,
    green,
    red);  // error: 'red' is declared twice
  Integer n = 1;
equation
end M;
