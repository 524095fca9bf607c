model M
  Boolean b;
equation
  b = sample(0, 1);  // error: 'sample'
end M;
