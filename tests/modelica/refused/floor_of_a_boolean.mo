model M
  Boolean b = time > 1;
  Real x = floor(b);  // error: 'floor' expects a number, not Boolean
equation
end M;
