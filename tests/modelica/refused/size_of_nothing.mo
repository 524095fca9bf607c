model M
  Integer n = size();  // error: needs arguments
end M;
