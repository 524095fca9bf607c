model M
  parameter Real p = q;  // error: depends on itself
  parameter Real q = p;
equation
end M;
