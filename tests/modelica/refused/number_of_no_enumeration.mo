model M
  Integer n = Integer(2.5);  // error: 'Integer' needs an enumeration
equation
end M;
