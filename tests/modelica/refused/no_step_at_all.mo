model M
  Real x = time;
equation
  annotation(__falsifier_solver(method = "fixed", step = 0));  // error: 'step' must be a number above 0
end M;
