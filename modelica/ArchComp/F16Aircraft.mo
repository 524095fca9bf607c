within ArchComp;
model F16Aircraft "F-16 with its inner control loop, as a component of its own: starts in a dive at 2338 ft with the attitude
(roll, pitch, yaw) and follows the load factor and the roll rate that an autopilot requests; negative altitude is a crash"
  extends F16Flight;
  input Real NzRequest(unit = "1", min = -10, max = 10, start = 0) "Load factor that the autopilot requests";
  input Real psRequest(unit = "rad/s", min = -1e4, max = 1e4, start = 0) "Stability roll rate that the autopilot requests";
equation
  NzRef = NzRequest;
  psRef = psRequest;
  annotation(
    experiment(StopTime = 15, Interval = 0.03333333333333333, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 1 / 120));
end F16Aircraft;
