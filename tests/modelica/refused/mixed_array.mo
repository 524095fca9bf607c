model M
  Boolean b[2];
equation
  b = {true, 1};  // error: different types
end M;
