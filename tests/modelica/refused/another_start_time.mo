model M
  Real x = time;
equation
  annotation(experiment(StartTime = 5, StopTime = 6));  // error: 'StartTime' must be 0
end M;
