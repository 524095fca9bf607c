model M
  Integer n = Integer(2.5);  // error: 'Integer' expects an enumeration
equation
end M;
