model M
  function f
    input Integer n;
    output Integer s = 0;
  algorithm
    for i in 1:n loop
      for i in 1:n loop  // error: outer loop
        s := s + i;
      end for;
    end for;
  end f;
  Integer k = f(2);
end M;
