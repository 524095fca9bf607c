model M
  Real x;
algorithm
  x := time;
  x := delay(x, 0.5);  // error: 'delay' in an algorithm is not supported
end M;
