model M
  Real x = time;
equation
  assert(x < 1, "late", AssertionLevel.warning);  // error: 'assert' expects a condition and a literal message
end M;
