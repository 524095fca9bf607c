model M
  flow Real x;  // error: 'flow'
equation
  x = 1;
end M;
