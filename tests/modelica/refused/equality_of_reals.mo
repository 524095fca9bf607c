model M
  Real x;
equation
  x = if time == 1 then 1 else 2;  // error: between Reals
end M;
