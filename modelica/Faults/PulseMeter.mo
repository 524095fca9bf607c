within Faults;
model PulseMeter "Water meter that counts the pulses of a reed contact. To spare its battery it goes to sleep when the
contact has been open for a while; the next pulse wakes it. A pulse that follows another one too soon is taken for the
contact's bouncing and not counted: missed says how many real pulses were lost"
  input Boolean contact(start = false) "Reed contact: closed while the magnet on the wheel passes";
  output Integer counted(start = 0, fixed = true, min = 0) "Pulses that the meter has counted";
  output Integer missed(start = 0, fixed = true, min = 0) "Pulses that the meter has lost";
  output Boolean asleep(start = false, fixed = true) "The meter sleeps";
  parameter Real period(unit = "s", min = 0.001) = 0.05 "Sample time of the contact";
  parameter Real sleepAfter(unit = "s", min = 0) = 6 "The meter sleeps when the contact has been open for so long";
  parameter Real bouncing(unit = "s", min = 0) = 0.1 "Pulses that follow sooner are not counted";
  parameter Real waking(unit = "s", min = 0) = 1.2 "Time in which the clock of the meter settles after its sleep";
protected
  Integer openTicks(start = 0, fixed = true) "Ticks since the contact was closed";
  Integer deadTicks(start = 0, fixed = true) "Ticks for which no pulse is counted";
  Boolean closed(start = false, fixed = true) "The contact at the last tick";
  Boolean pulse(start = false, fixed = true) "A pulse begins at this tick";
equation
  when sample(0, period) then
    closed = contact;
    pulse = contact and not pre(closed);
    openTicks = if contact then 0 else pre(openTicks) + 1;
    asleep = not contact and openTicks * period >= sleepAfter - period / 2;
    counted = if pulse and pre(deadTicks) == 0 then pre(counted) + 1 else pre(counted);
    missed = if pulse and pre(deadTicks) > 0 then pre(missed) + 1 else pre(missed);
    // The fault: after its sleep the meter waits for its clock before it trusts the contact again.
    deadTicks = if pulse and pre(deadTicks) == 0
      then integer((if pre(asleep) then waking else bouncing) / period + 0.5) else max(0, pre(deadTicks) - 1);
  end when;
  // A tick at the end of a communication step is repeated with the inputs that follow: it sees them without delay.
  annotation(
    experiment(StopTime = 12, Interval = 0.05),
    __falsifier_solver(repeatTicks = "always"));
end PulseMeter;
