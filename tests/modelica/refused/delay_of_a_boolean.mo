model M
  Boolean b = time > 1;
  Real x;
equation
  x = delay(b, 1);  // error: expected Real, found Boolean
end M;
