model M
  Real x = 1;
equation
  annotation(__falsifier_solver(stepp = 0.1));  // error: stepp
end M;
