model M
  parameter Real p(fixed = false, start = 2);  // error: 'fixed = false' is not supported
  Real x = p;
equation
end M;
