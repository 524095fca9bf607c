model M
  model A
    Real y = 1;
  end A;
  A a(redeclare Real y = 2);  // error: 'redeclare'
equation
end M;
