model M
  Real x = time;
equation
  assert(x < 1, "late", AssertionLevel.warning);  // error: 'assert' takes a condition and a literal message
end M;
