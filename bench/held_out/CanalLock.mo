model CanalLock "Canal lock with two gates and two sluices, which takes one command at a time. A gate opens only at its water level,
and only if the sluice of the other side and the other gate are closed; a boat that waits goes in when the lower gate opens, and
out when the upper one does. A command that is not allowed sounds the horn, which blocks all commands for some time"
  input Integer command(min = 0, max = 8, start = 0)
    "0 wait; open and close: 1 and 2 the filling sluice, 3 and 4 the drain, 5 and 6 the upper gate, 7 and 8 the lower gate";
  output Real level(unit = "1", start = 0, fixed = true, min = 0, max = 1) "Water level in the chamber; 0 low, 1 high";
  output Boolean filling(start = false, fixed = true) "The filling sluice is open";
  output Boolean draining(start = false, fixed = true) "The drain is open";
  output Boolean upper(start = false, fixed = true) "The upper gate is open";
  output Boolean lower(start = false, fixed = true) "The lower gate is open";
  output Integer inside(start = 0, fixed = true, min = 0) "Boats in the chamber";
  output Integer lifted(start = 0, fixed = true, min = 0) "Boats that have left at the upper gate";
  parameter Real period(unit = "s", min = 0.1) = 1 "Sample time of the controller";
  parameter Real flowing(unit = "s", min = 1) = 6 "Time constant of filling and draining";
  parameter Real blocking(unit = "s", min = 0) = 6 "Time for which the horn blocks all commands";
protected
  Boolean allowed(start = false, fixed = true) "The command is allowed";
  Integer blocked(start = 0, fixed = true) "Ticks for which commands are still blocked";
  Integer given(start = 0, fixed = true) "The last command";
  Boolean fresh(start = false, fixed = true) "The command has changed";
equation
  der(level) = ((if filling then 1 - level else 0) - (if draining then level else 0)) / flowing;
  when sample(0, period) then
    given = command;
    fresh = command <> pre(given) and command > 0;
    // The fault: the drain may be opened while water flows in, and draining is not checked when a gate is opened below.
    allowed = command == 1 and not pre(draining) and not pre(lower) or command == 2 or command == 3 and not pre(upper)
      or command == 4 or command == 5 and level > 0.95 and not pre(lower) or command == 6
      or command == 7 and level < 0.05 and not pre(upper) and not pre(filling) or command == 8;
    blocked = if fresh and not allowed and pre(blocked) == 0 then integer(blocking / period) else max(0, pre(blocked) - 1);
    filling = if blocked > 0 then pre(filling) elseif command == 1 and allowed then true elseif command == 2 then false
      else pre(filling);
    draining = if blocked > 0 then pre(draining) elseif command == 3 and allowed then true elseif command == 4 then false
      else pre(draining);
    upper = if blocked > 0 then pre(upper) elseif command == 5 and allowed then true elseif command == 6 then false
      else pre(upper);
    lower = if blocked > 0 then pre(lower) elseif command == 7 and allowed then true elseif command == 8 then false
      else pre(lower);
    inside = if upper then 0 elseif lower and not pre(lower) then 1 else pre(inside);
    lifted = if upper and not pre(upper) then pre(lifted) + pre(inside) else pre(lifted);
  end when;
  // A tick at the end of a communication step is repeated with the next step's inputs, so it uses them without delay.
  annotation(
    experiment(StopTime = 240, Interval = 1, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.5, repeatTicks = "always"));
end CanalLock;
