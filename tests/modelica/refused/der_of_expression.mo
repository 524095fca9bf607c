model M
  Real x;
equation
  der(2 * x) = 1;  // error: needs a variable
end M;
