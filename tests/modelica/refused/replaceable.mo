model M
  replaceable Real x;  // error: 'replaceable' is not supported
equation
  x = 1;
end M;
