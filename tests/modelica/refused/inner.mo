model M
  inner Real x;  // error: 'inner' is not supported
equation
  x = 1;
end M;
