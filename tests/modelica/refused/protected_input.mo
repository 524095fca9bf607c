model M
  Real x = u;
protected
  input Real u;  // error: the input 'u' is protected
equation
end M;
