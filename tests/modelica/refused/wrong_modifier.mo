model M
  model A
    Real y = 1;
  end A;
  A a(z = 2);  // error: no component 'z'
equation
end M;
