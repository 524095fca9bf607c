model BuckledBeam "Energy harvester: a buckled beam on a shaking machine, which jumps between its two bent shapes. Its motion is
chaotic for most strengths of the shaking. Each jump to the right charges the store by one; a store that is not charged for some
time loses a charge"
  input Real strength(unit = "1", min = 0, max = 0.6, start = 0.2) "Amplitude of the machine's shaking";
  input Real pull(unit = "1", min = -0.3, max = 0.3, start = 0) "Steady load on the beam";
  output Real bend(unit = "1", start = -1, fixed = true) "Middle of the beam; it rests at -1 or 1";
  output Real speed(unit = "1", start = 0, fixed = true) "Speed of its middle";
  output Integer jumps(start = 0, fixed = true, min = 0) "Jumps to the right so far";
  output Integer charge(start = 0, fixed = true, min = 0) "Charges in the store";
  parameter Real damping(unit = "1", min = 0) = 0.25 "Damping";
  parameter Real frequency(unit = "rad/s", min = 0) = 1 "Angular frequency of the shaking";
  parameter Real leak(unit = "s", min = 0.1) = 12 "Time without a jump after which a charge is lost";
protected
  Boolean right(start = false, fixed = true) "The beam has jumped to the right and not yet back";
  Real since(unit = "s", start = 0, fixed = true) "Time of the last jump or loss";
equation
  der(bend) = speed;
  der(speed) = bend - bend ^ 3 - damping * speed + strength * cos(frequency * time) + pull;
  when sample(0, 0.05) then
    right = bend > 0.5 or pre(right) and bend > -0.5;
    jumps = if right and not pre(right) then pre(jumps) + 1 else pre(jumps);
    since = if jumps > pre(jumps) or time > pre(since) + leak then time else pre(since);
    charge = if jumps > pre(jumps) then pre(charge) + 1 elseif time > pre(since) + leak then max(0, pre(charge) - 1)
      else pre(charge);
  end when;
  annotation(
    experiment(StopTime = 120, Interval = 0.1, Tolerance = 1e-8),
    __falsifier_solver(method = "fixed", step = 0.025, repeatTicks = "always"));
end BuckledBeam;
