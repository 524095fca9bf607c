model M
  Real x(start = 1);
equation
  der(x) = -x;
  annotation(__falsifier_solver(checks = 0.5));  // error: whole number
end M;
