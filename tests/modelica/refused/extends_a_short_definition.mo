model A
  Real x = time;
equation
end A;
model B = A;  // error: the short definition of 'B'
model M
  extends B;
  Real y = 1;
equation
end M;
