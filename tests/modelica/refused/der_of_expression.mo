model M
  Real x;
equation
  der(2 * x) = 1;  // error: must be a variable
end M;
