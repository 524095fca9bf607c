model M
  Real x(start = 0);
equation
  when time > 0.5 then
    x = 1;
    x = 2;  // error: already has an equation here, at when_sets_twice.mo:5
  end when;
end M;
