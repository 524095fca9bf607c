model Servo "Digital position servo that turns a load by a given angle and is then pushed. The controller is a PID with a filtered
derivative; the encoder has a limited resolution, and the command arrives some samples late"
  parameter Real proportional(unit = "V/rad", min = 5, max = 120) = 30 "Proportional gain";
  parameter Real integral(unit = "V/(rad.s)", min = 0, max = 200) = 40 "Integral gain";
  parameter Real derivative(unit = "V.s/rad", min = 0, max = 4) = 1 "Derivative gain";
  parameter Real inertia(unit = "kg.m2", min = 0.005, max = 0.05) = 0.015 "Inertia of the load";
  parameter Real friction(unit = "N.m", min = 0, max = 0.3) = 0.1 "Dry friction";
  parameter Real supply(unit = "V", min = 8, max = 30) = 24 "Voltage of the supply, which limits the command";
  parameter Real turn(unit = "rad", min = 0.2, max = 3) = 1 "Wanted angle";
  parameter Real push(unit = "N.m", min = 0, max = 0.6) = 0.3 "Torque that pushes the load from 1.5 s on";
  parameter Integer divider(min = 1, max = 8) = 2 "Sample time of the controller, in units of 2 ms";
  parameter Integer late(min = 0, max = 5) = 1 "Samples by which the command is late";
  parameter Integer smooth(min = 1, max = 12) = 4 "Samples over which the derivative is averaged";
  parameter Integer bits(min = 5, max = 12) = 9 "Resolution of the encoder: two to this power counts per turn";
  output Real angle(unit = "rad", start = 0, fixed = true) "Angle of the load";
  output Real speed(unit = "rad/s", start = 0, fixed = true, nominal = 10) "Speed of the load";
  output Real error(unit = "rad") "Wanted angle minus angle, as a share of the wanted angle";
  discrete output Real voltage(unit = "V", start = 0, fixed = true, nominal = 10) "Voltage at the motor";
protected
  constant Real torque(unit = "N.m/V") = 0.08 "Torque per volt";
  constant Real braking(unit = "N.m.s/rad") = 0.05 "Torque per speed, by the motor's own voltage";
  Integer ticks(start = 0, fixed = true) "Ticks of 2 ms until the next sample";
  discrete Real seen(start = 0, fixed = true) "Difference to the wanted angle, by the encoder";
  discrete Real slope(start = 0, fixed = true) "Filtered derivative of the angle";
  discrete Real sum(start = 0, fixed = true) "Integral term";
  discrete Real command[6](each start = 0, each fixed = true) "The last commands, newest first";
  discrete Real count(start = 0, fixed = true) "Angle by the encoder";

  function drive "Angular acceleration of the load; dry friction is smoothed"
    input Real voltage;
    input Real speed;
    input Real load;
    input Real friction;
    input Real inertia;
    output Real acceleration;
  algorithm
    acceleration := (torque * voltage - braking * speed - friction * tanh(speed / 0.02) - load) / inertia;
  end drive;
equation
  error = (turn - angle) / turn;
  der(angle) = speed;
  der(speed) = drive(voltage, speed, if time > 1.5 then push else 0, friction, inertia);
  when sample(0, 0.002) then
    ticks = if pre(ticks) <= 0 then divider - 1 else pre(ticks) - 1;
    count = if pre(ticks) <= 0 then floor(angle * 2 ^ bits / 6.283185307179586) * 6.283185307179586 / 2 ^ bits
      else pre(count);
    seen = turn - count;
    slope = if pre(ticks) <= 0 then pre(slope) + ((count - pre(count)) / (0.002 * divider) - pre(slope)) / smooth
      else pre(slope);
    sum = if pre(ticks) <= 0 and abs(pre(command[1])) < supply then pre(sum) + integral * seen * 0.002 * divider
      else pre(sum);
    command[1] = if pre(ticks) <= 0 then max(-supply, min(supply, proportional * seen + sum - derivative * slope))
      else pre(command[1]);
    command[2] = if pre(ticks) <= 0 then pre(command[1]) else pre(command[2]);
    command[3] = if pre(ticks) <= 0 then pre(command[2]) else pre(command[3]);
    command[4] = if pre(ticks) <= 0 then pre(command[3]) else pre(command[4]);
    command[5] = if pre(ticks) <= 0 then pre(command[4]) else pre(command[5]);
    command[6] = if pre(ticks) <= 0 then pre(command[5]) else pre(command[6]);
    voltage = if late == 0 then command[1] elseif late == 1 then command[2] elseif late == 2 then command[3]
      elseif late == 3 then command[4] elseif late == 4 then command[5] else command[6];
  end when;
  annotation(
    experiment(StopTime = 3, Interval = 0.01, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.001, repeatTicks = "never"));
end Servo;
