model M
  Real x(strat = 1);  // error: no attribute 'strat'
equation
  x = 1;
end M;
