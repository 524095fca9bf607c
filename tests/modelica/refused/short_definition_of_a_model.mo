model A
  Real x = time;
equation
end A;
model M = A;  // error: the short definition of 'M'
