model M
  Integer n(start=0);
equation
  when sample(0, time) then  // error: parameters
    n = 1;
  end when;
end M;
