model M
  Real x = time;
  Real y = pre(x);  // error: when clause
equation
end M;
