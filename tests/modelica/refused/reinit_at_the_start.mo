model M
  Real x(start = 1);
equation
  der(x) = -x;
  when {initial(), x < 0.5} then
    reinit(x, 2);  // error: initial equation
  end when;
end M;
