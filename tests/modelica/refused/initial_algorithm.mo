model M
  Real x;
initial algorithm  // error: initial algorithm
  x := 1;
equation
  der(x) = 1;
end M;
