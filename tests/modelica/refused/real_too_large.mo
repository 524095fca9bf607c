model M
  Real x = 1e400 * time;  // error: too large
end M;
