model M
  Boolean b = time > 1;
  Real x = b / 2;  // error: expects numbers, not Boolean
end M;
