model M
  Real x(start = 0);
equation
  when time > 1 then
    x = delay(time, 0.5);  // error: 'delay' and 'spatialDistribution' are only allowed in equations
  end when;
end M;
