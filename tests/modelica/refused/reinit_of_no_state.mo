model M
  Real x = time;
equation
  when time > 1 then
    reinit(x, 1);  // error: not a state
  end when;
end M;
