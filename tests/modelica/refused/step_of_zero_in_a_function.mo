model M
  function f
    input Integer n;
    output Integer s = 0;
  algorithm
    for i in 1:0:n loop  // error: must not be 0
      s := s + i;
    end for;
  end f;
  Integer k = f(2);
end M;
