model M
  Real x;
equation
  if time > 0.5 then
    x = 1;
    x = 2;  // error: already has an equation here
  else
    x = 3;
  end if;
end M;
