model M
  partial model A
    Real y;
  end A;
  A a;  // error: 'M.A' is partial
equation
  a.y = 1;
end M;
