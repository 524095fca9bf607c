within Faults;
model PulseMeter "Water meter that counts the pulses of a reed contact. To save its battery, it falls asleep if the contact
has been open for some time; the next pulse wakes it up. A pulse that follows too soon after another one is considered a
bounce of the contact and not counted; missed is the number of real pulses that were lost in this way"
  input Boolean contact(start = false) "Reed contact: closed while the magnet on the wheel passes";
  output Integer counted(start = 0, fixed = true, min = 0) "Number of counted pulses";
  output Integer missed(start = 0, fixed = true, min = 0) "Number of lost pulses";
  output Boolean asleep(start = false, fixed = true) "The meter is asleep";
  parameter Real period(unit = "s", min = 0.001) = 0.05 "Sample time of the contact";
  parameter Real sleepAfter(unit = "s", min = 0) = 6 "Time for which the contact must be open before the meter falls asleep";
  parameter Real bouncing(unit = "s", min = 0) = 0.1 "Time after a pulse during which no other pulse is counted";
  parameter Real waking(unit = "s", min = 0) = 1.2 "Time after waking up during which no pulse is counted";
protected
  Integer openTicks(start = 0, fixed = true) "Ticks since the contact was closed";
  Integer deadTicks(start = 0, fixed = true) "Remaining ticks during which no pulse is counted";
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
    // The fault: after waking up the meter ignores the contact until its clock has settled.
    deadTicks = if pulse and pre(deadTicks) == 0
      then integer((if pre(asleep) then waking else bouncing) / period + 0.5) else max(0, pre(deadTicks) - 1);
  end when;
  // A tick at the end of a communication step is repeated with the next step's inputs, so it uses them without delay.
  annotation(
    experiment(StopTime = 12, Interval = 0.05),
    __falsifier_solver(repeatTicks = "always"));
end PulseMeter;
