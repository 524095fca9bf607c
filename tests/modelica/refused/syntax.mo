model M
  Real x
equation  // error: syntax error
  x = 1;
end M;
