model M
  Integer n(start = 0);
  Real x(start = 0);
equation
  n = if time > 1 then 1 else 0;
  when edge(n) then  // error: 'edge' of Integer
    x = 1;
  end when;
end M;
