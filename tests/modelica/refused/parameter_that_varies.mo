model M
  Real x = time;
  parameter Real p = x;  // error: may only depend on parameters
equation
end M;
