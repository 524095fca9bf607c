model M
  discrete Real d = time;  // error: the discrete variable 'd' is not set in a when clause
equation
end M;
