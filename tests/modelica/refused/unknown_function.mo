model M
  Real x;
equation
  x = delight(time);  // error: no class 'delight'
end M;
