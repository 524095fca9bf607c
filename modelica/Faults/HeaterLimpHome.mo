within Faults;
model HeaterLimpHome "Heated bath with a PI controller. While its two temperature sensors disagree, the controller is in
limp-home mode: the power is limited, and the integral term is frozen until the mode ends. A sensor that is far off counts
as failed and is not used, and sensors that agree exactly count as one that is read twice: neither changes the mode. If the
bath gets too hot, a safety switch turns the heater off permanently and counts a trip"
  input Real disagreement(unit = "K", min = 0, max = 10, start = 5) "Difference between the two sensors";
  output Real temperature(unit = "degC", start = 60, fixed = true, nominal = 10) "Temperature of the bath";
  output Real power(unit = "%", start = 50, fixed = true, min = 0, max = 100) "Heater power";
  output Boolean limp(start = false, fixed = true) "The controller is in limp-home mode";
  output Integer trips(start = 0, fixed = true, min = 0) "Number of times that the safety switch has acted";
  parameter Real period(unit = "s", min = 0.001) = 0.1 "Sample time of the controller";
  parameter Real wanted(unit = "degC") = 60 "Temperature set point";
  parameter Real hottest(unit = "degC") = 64 "Temperature at which the safety switch acts";
  parameter Real limited(unit = "%", min = 0, max = 100) = 30 "Maximum power in limp-home mode";
  parameter Real enterAbove(unit = "K") = 6.8 "Disagreement above which limp-home mode begins";
  parameter Real failedAbove(unit = "K") = 7.2 "Disagreement above which one sensor counts as failed";
  parameter Real leaveBelow(unit = "K") = 0.3 "Disagreement below which limp-home mode ends";
  parameter Real sameBelow(unit = "K") = 0.1 "Disagreement below which one sensor seems to be read twice";
  parameter Real leaveAfter(unit = "s", min = 0) = 1 "Time for which the sensors must agree before the mode ends";
  parameter Real settling(unit = "s", min = 0) = 1.5 "Time after limp-home mode before the integral term can be frozen again";
  parameter Real proportional(unit = "%/K", min = 0) = 5 "Proportional gain of the controller";
  parameter Real integral(unit = "%/(K.s)", min = 0) = 0.2 "Integral gain of the controller";
  parameter Real tracking(unit = "1/s", min = 0) = 0.5 "Rate of the anti-windup while the power is limited";
protected
  constant Real outside(unit = "degC") = 20;
  constant Real lag(unit = "s") = 40 "Time constant of the bath";
  constant Real reach(unit = "K") = 80 "Steady-state temperature rise at full power";
  Integer calm(start = 0, fixed = true) "Ticks since the sensors started to agree";
  Integer pause(start = 1000000, fixed = true) "Ticks since limp-home mode ended; does not count during it";
  Boolean frozen(start = false, fixed = true) "The integral term is frozen";
  Real sum(unit = "%", start = 50, fixed = true) "Integral term";
  Real command(unit = "%", start = 50, fixed = true) "Power requested by the controller, before its limits";
  Real error(unit = "K", start = 0, fixed = true);
equation
  der(temperature) = (outside + reach * (if trips > 0 then 0 else power) / 100 - temperature) / lag;
algorithm
  when sample(0, period) then
    calm := if disagreement < leaveBelow and disagreement > sameBelow then pre(calm) + 1 else 0;
    limp := disagreement > enterAbove and disagreement < failedAbove
      or pre(limp) and (calm - 1) * period < leaveAfter - period / 2;
    pause := if not limp and pre(limp) then 0 elseif pre(limp) then pre(pause) else min(1000000, pre(pause) + 1);
    // The integral term is frozen when limp-home mode begins, unless the last phase ended less than settling ago.
    frozen := limp and (pre(frozen) or not pre(limp) and pause * period >= settling);
    error := wanted - temperature;
    command := proportional * error + pre(sum);
    power := min(if limp then limited else 100, max(0, command));
    if limp and not frozen then
      // The fault: the sign. It winds the integral term up, which has no visible effect before limp-home mode ends.
      sum := min(100, pre(sum) + tracking * (command - power) * period);
    elseif not limp and command > 0 and command < 100 then
      sum := pre(sum) + integral * error * period;
    end if;
    trips := if temperature >= hottest and pre(trips) == 0 then 1 else pre(trips);
  end when;
  // A tick at the end of a communication step is repeated with the next step's inputs, so it uses them without delay.
  annotation(
    experiment(StopTime = 40, Interval = 0.1, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.1, repeatTicks = "always"));
end HeaterLimpHome;
