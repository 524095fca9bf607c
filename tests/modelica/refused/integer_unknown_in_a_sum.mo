model M
  Integer n;
equation
  n + 0.5 = time;  // error: cannot be solved
end M;
