model M
  Real x = max(zeros(0));  // error: empty
end M;
