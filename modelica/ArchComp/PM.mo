within ArchComp;
model PM "Pacemaker in mode AOO: paces the heart at the lower rate limit, regardless of
its own activity, one pulse per cycle; PACE_COUNT counts the pulses since the start"
  constant Real tick(unit = "s") = 0.001 "Sample time of the controller; the counters below count ticks of 1 ms";
  constant Integer Off = 0 "Not yet started";
  constant Integer Ready = 1 "Started, outputs cleared";
  constant Integer Charge = 2 "Charges the pulse";
  constant Integer Pace = 3 "Paces the heart";
  parameter Integer pulseWidth(min = 1, max = 10) = 2 "Length of a pulse in ms";
  input Real LRL_input(start = 60, min = 30, max = 175, unit = "1/min") "Lower rate limit: heart beats per minute";
  discrete output Real Period(unit = "ms", start = 0, fixed = true) "Length of a heart cycle, rounded down";
  output Integer LRL(start = 0, fixed = true) "Lower rate limit in use, in beats per minute, rounded down";
  output Integer PACE_COUNT(start = 0, fixed = true) "Number of pulses since the start";
protected
  Integer phase(start = Off, fixed = true) "Off, Ready, Charge or Pace";
  Integer elapsed(start = 0, fixed = true) "Ticks since the phase was entered";
  Integer chargeTicks(start = 0, fixed = true) "Duration of charging in ticks, for the current rate limit";
equation
  when sample(0, tick) then
    LRL = integer(LRL_input);
    Period = floor(60000 / LRL);
    chargeTicks = integer(60000 / LRL - pulseWidth + 0.5);
    phase = if pre(phase) == Off then Ready
      elseif pre(phase) == Ready then Charge
      elseif pre(phase) == Charge then (if pre(elapsed) + 1 >= chargeTicks then Pace else Charge)
      else (if pre(elapsed) + 1 >= pulseWidth then Charge else Pace);
    elapsed = if phase == pre(phase) then pre(elapsed) + 1 else 0;
    PACE_COUNT = if phase == Pace and pre(phase) == Charge then pre(PACE_COUNT) + 1 else pre(PACE_COUNT);
  end when;
  // A tick at the end of a communication step is repeated with the next step's inputs, so it uses them without delay.
  annotation(
    experiment(StopTime = 10, Interval = 0.001),
    __falsifier_solver(repeatTicks = "always"));
end PM;
