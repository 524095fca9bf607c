model M
  Real x, y;
algorithm
  x := time;
  y := if x > 0.5 then 1 else 0;
  x := 2 * x;  // error: 'x' is set again
end M;
