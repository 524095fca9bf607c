model M
  parameter Real p;  // error: has no value
  Real x = p;
equation
end M;
