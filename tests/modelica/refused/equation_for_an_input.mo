model M
  input Real u;
equation
  u = 1;  // error: no unknown variable
end M;
