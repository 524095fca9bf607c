model M
  Real x(start = 1);
equation
  der(x) = -x;
  annotation(__falsifier_solver(step = 0.01));  // error: no effect
end M;
