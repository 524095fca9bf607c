within Faults;
model HeaterLimpHome "Heated bath under a PI controller. While two sensors of its temperature disagree the controller is
in limp-home: the power is limited, and the integral part is kept for the time after it. When the bath gets too hot, a
safety switch turns the heater off for good and counts a trip"
  input Real disagreement(unit = "K", min = 0, max = 10, start = 5) "Difference between the two sensors";
  output Real temperature(unit = "degC", start = 60, fixed = true, nominal = 10) "Temperature of the bath";
  output Real power(unit = "%", start = 50, fixed = true, min = 0, max = 100) "Power of the heater";
  output Boolean limp(start = false, fixed = true) "The controller is in limp-home";
  output Integer trips(start = 0, fixed = true, min = 0) "How often the safety switch has acted";
  parameter Real period(unit = "s", min = 0.001) = 0.1 "Sample time of the controller";
  parameter Real wanted(unit = "degC") = 60 "Set point of the temperature";
  parameter Real hottest(unit = "degC") = 64 "Temperature at which the safety switch acts";
  parameter Real limited(unit = "%", min = 0, max = 100) = 30 "Largest power in limp-home";
  parameter Real enterAbove(unit = "K") = 9.5 "A disagreement above this one begins limp-home";
  parameter Real leaveBelow(unit = "K") = 0.2 "It ends when the disagreement has been below this one";
  parameter Real leaveAfter(unit = "s", min = 0) = 1 "for so long";
  parameter Real valid(unit = "s", min = 0) = 1.5 "What was kept in limp-home is valid for so long after it";
  parameter Real settling(unit = "s", min = 0) = 4 "After limp-home nothing new is kept for so long";
  parameter Real proportional(unit = "%/K", min = 0) = 5 "Gain of the controller";
  parameter Real integral(unit = "%/(K.s)", min = 0) = 0.2 "Gain of its integral part";
  parameter Real tracking(unit = "1/s", min = 0) = 0.5 "Rate at which the integral part follows a limited power";
protected
  constant Real outside(unit = "degC") = 20;
  constant Real lag(unit = "s") = 40 "Time constant of the bath";
  constant Real reach(unit = "K") = 80 "By how much full power heats the bath in the end";
  Integer calm(start = 0, fixed = true) "Ticks since the sensors have come to agree";
  Integer pause(start = 1000000, fixed = true) "Ticks since limp-home has ended; stands still while it is on";
  Boolean kept(start = false, fixed = true) "The integral part is kept as it is";
  Real sum(unit = "%", start = 50, fixed = true) "Integral part";
  Real command(unit = "%", start = 50, fixed = true) "Power that the controller would like";
  Real error(unit = "K", start = 0, fixed = true);
equation
  der(temperature) = (outside + reach * (if trips > 0 then 0 else power) / 100 - temperature) / lag;
algorithm
  when sample(0, period) then
    calm := if disagreement < leaveBelow then pre(calm) + 1 else 0;
    limp := disagreement > enterAbove or pre(limp) and (calm - 1) * period < leaveAfter - period / 2;
    pause := if not limp and pre(limp) then 0 elseif pre(limp) then pre(pause) else min(1000000, pre(pause) + 1);
    // The integral part is kept from the beginning of limp-home on, or still kept from the last time.
    kept := limp and (pre(kept) or not pre(limp) and (pause * period >= settling or pause * period < valid));
    error := wanted - temperature;
    command := proportional * error + pre(sum);
    power := min(if limp then limited else 100, max(0, command));
    if limp and not kept then
      // The fault: the sign. It drives the integral part away from the limit, which nobody sees before limp-home ends.
      sum := min(100, pre(sum) + tracking * (command - power) * period);
    elseif not limp and command > 0 and command < 100 then
      sum := pre(sum) + integral * error * period;
    end if;
    trips := if temperature >= hottest and pre(trips) == 0 then 1 else pre(trips);
  end when;
  // A tick at the end of a communication step is repeated with the inputs that follow: it sees them without delay.
  annotation(
    experiment(StopTime = 40, Interval = 0.1, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.1, repeatTicks = "always"));
end HeaterLimpHome;
