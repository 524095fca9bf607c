model M
  Real x;
initial equation
  x = 1;
  x = 2;  // error: already has an initial equation at two_initial_equations.mo:4
equation
  der(x) = 0;
end M;
