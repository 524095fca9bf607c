model M
  Real x;
equation
  x = 1 + true;  // error: numbers
end M;
