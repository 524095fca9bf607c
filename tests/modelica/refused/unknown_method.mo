model M
  Real x = time;
equation
  annotation(__falsifier_solver(method = "euler"));  // error: one of fixed, adaptive, implicit
end M;
