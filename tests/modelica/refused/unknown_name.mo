model M
  Real x;
equation
  x = time + nothing;  // error: no variable 'nothing'
end M;
