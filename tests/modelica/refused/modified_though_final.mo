model M
  model A
    parameter Real k = 1;
    Real x = k;
  equation
  end A;
  model B
    A a(final k = 3);
  end B;
  B b(a(k = 4));  // error: this is final and cannot be modified
equation
end M;
