within ArchComp;
model CC "Chasing cars: five cars in a row drive towards negative y. Car 1 leads (y1, driven by throttle and
brake), car 5 is last; y(i+1) - yi is the gap between a car and the one ahead of it, 10 m at the start"
  input Real throttle(start = 0, min = 0, max = 1, unit = "1")
    "Throttle of the leading car: pushes it towards negative y";
  input Real brake(start = 0, min = 0, max = 1, unit = "1")
    "Brake of the leading car: damps its speed";
  output Real y1(unit = "m", start = 0, fixed = true) "Position of car 1, the leader";
  output Real y2(unit = "m") "Position of car 2, which follows car 1";
  output Real y3(unit = "m") "Position of car 3, which follows car 2";
  output Real y4(unit = "m") "Position of car 4, which follows car 3";
  output Real y5(unit = "m") "Position of car 5, the last one";
  Real v1(unit = "m/s", start = 0, fixed = true) "Velocity of car 1, negative when it drives forward";
  CCFollower car2(y(start = 10)) "Follows car 1";
  CCFollower car3(y(start = 20)) "Follows car 2";
  CCFollower car4(y(start = 30)) "Follows car 3";
  CCFollower car5(y(start = 40)) "Follows car 4";
equation
  der(y1) = v1;
  der(v1) = -throttle - brake * v1;
  car2.ahead = y1;
  car3.ahead = car2.y;
  car4.ahead = car3.y;
  car5.ahead = car4.y;
  y2 = car2.y;
  y3 = car3.y;
  y4 = car4.y;
  y5 = car5.y;
  // Between events the accelerations are (nearly) constant, so the error of a step of 0.01 s is a rounding error.
  annotation(
    experiment(StopTime = 100, Interval = 0.01, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.01));
end CC;
