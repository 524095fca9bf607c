model M
  Real x;
  Real y;
equation
  if time > 1 then  // error: every branch
    x = 1;
  else
    y = 1;
  end if;
end M;
