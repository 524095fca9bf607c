model M
  Real x(start = 0);
equation
  if time > 2 then
    when time > 3 then  // error: 'when' inside 'if'
      x = 1;
    end when;
  end if;
end M;
