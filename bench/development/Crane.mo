model Crane "Trolley crane in the wind. A learnt controller moves the trolley to its target and damps the swing of the load; it was
trained with random states, not with targets that change in time with the swing"
  input Real target(unit = "m", min = 0, max = 20, start = 10) "Wanted position of the trolley";
  input Real wind(unit = "m/s2", min = -0.15, max = 0.15, start = 0) "Acceleration of the load by the wind";
  output Real trolley(unit = "m", start = 10, fixed = true, nominal = 10) "Position of the trolley";
  output Real speed(unit = "m/s", start = 0, fixed = true) "Speed of the trolley";
  output Real angle(unit = "rad", start = 0, fixed = true) "Angle of the rope";
  output Real load(unit = "m") "Position of the load";
  discrete output Real command(unit = "m/s2", start = 0, fixed = true) "Acceleration of the trolley, by the controller";
  parameter Real period(unit = "s", min = 0.01) = 0.1 "Sample time of the controller";
  parameter Real rope(unit = "m", min = 1) = 8 "Length of the rope";
  parameter Real limit(unit = "m/s2", min = 0) = 1.5 "Maximum acceleration of the trolley";
protected
  constant Real gravity = 9.81;
  constant Real states[8, 4] = {{0.0288956, 1.40782, -0.276356, -0.229597},
    {1.76114, -3.03237, 1.16579, 0.907123},
    {0.691168, -1.92007, 0.618656, 0.478606},
    {2.24486, -2.43426, 1.26053, 0.966264},
    {-1.63747, 1.1647, -0.875244, -0.656237},
    {-1.35499, 0.337001, -0.695219, -0.515834},
    {-0.288211, -0.203669, -0.993399, -0.300121},
    {-0.15228, -0.14619, -0.979162, -0.243755}};
  constant Real offset[8] = {0.00390156, -0.00454968, -0.00199758, 0.000751384, -0.00434046, 0.00533906, -0.0123689, -0.032549};
  constant Real units[8] = {-0.184924, 0.832623, -0.579516, 1.0742, 0.729236, -0.260433, 0.0197359, -0.0225207};
  Real turning(start = 0, fixed = true) "Angular speed of the rope";

  function network "Eight tanh units, see bench/train_crane.py"
    input Real distance;
    input Real speed;
    input Real angle;
    input Real turning;
    output Real y;
  protected
    Real x[4];
    Real z;
  algorithm
    x := {distance / 10, speed / 4, angle / 0.3, turning / 0.3};
    y := 0;
    for i in 1:8 loop
      z := offset[i];
      for j in 1:4 loop
        z := z + states[i, j] * x[j];
      end for;
      y := y + units[i] * tanh(z);
    end for;
  end network;
equation
  load = trolley + rope * sin(angle);
  der(trolley) = speed;
  der(speed) = command;
  der(angle) = turning;
  der(turning) = (-gravity * sin(angle) + (wind - command) * cos(angle)) / rope - 0.02 * turning;
  when sample(0, period) then
    command = limit * min(1, max(-1, network(target - trolley, speed, angle, turning)));
  end when;
  annotation(
    experiment(StopTime = 60, Interval = 0.1, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.05, repeatTicks = "always"));
end Crane;
