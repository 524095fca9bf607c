model M
  Real x;
algorithm
  while x < 1 loop  // error: 'while'
    x := x + 1;
  end while;
end M;
