model M
  Boolean b[2] = {time > 2, time > 1};
  Integer n(start = 0);
equation
  when edge(b) then  // error: needs a scalar
    n = pre(n) + 1;
  end when;
end M;
