within Features;
model Stiff "Stiff equations, integrated implicitly: fast decay to a slow solution, nonlinear, with events"
  parameter Real rate(unit = "1/s") = 1e6 "How fast the fast part decays";
  output Real follower(start = 1, fixed = true) "Follows cos(time)";
  output Real level(start = 1, fixed = true) "Falls as the square root, held by a strong inflow";
  output Real slow(start = 1, fixed = true) "Exponential decay";
  output Real echo(start = 0, fixed = true) "Follows the follower of 0.5 s ago";
  output Integer turns(start = 0) "How often the slow part has been halved";
equation
  der(follower) = -rate * (follower - cos(time)) - sin(time);
  der(level) = 100 * slow - sqrt(rate) * sqrt(max(level, 0));
  der(slow) = -slow;
  der(echo) = 50 * (delay(follower, 0.5) - echo);
  when {slow < 0.5, slow < 0.25, slow < 0.125} then
    turns = pre(turns) + 1;
  end when;
  annotation(experiment(StopTime = 6, Interval = 0.1, Tolerance = 1e-8), __falsifier_solver(method = "implicit"));
end Stiff;
