model M
  parameter Real p = 1;
  input Real u(start = p);  // error: start value of the input 'u'
  Real x = u;
equation
end M;
