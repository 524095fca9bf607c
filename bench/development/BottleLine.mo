model BottleLine "Bottle filling line, driven by one command at a time: feed a bottle, fill it, cap it, push it into the box.
A command that does not fit the stage rejects the bottle. The nozzle must be rinsed after each bottle"
  input Integer command(min = 0, max = 5, start = 0)
    "0 wait, 1 feed a bottle, 2 fill, 3 cap, 4 push into the box, 5 rinse the nozzle";
  output Integer stage(start = 0, fixed = true, min = 0) "0 no bottle, 1 placed, 2 being filled, 3 capped";
  output Real level(unit = "1", start = 0, fixed = true, min = 0, max = 2) "Filling level of the bottle; 1 is full";
  output Integer boxed(start = 0, fixed = true, min = 0) "Bottles in the box";
  output Integer sinceRinse(start = 0, fixed = true, min = 0) "Bottles boxed since the nozzle was rinsed";
  output Integer underfilled(start = 0, fixed = true, min = 0) "Bottles boxed that were not full";
  parameter Real period(unit = "s", min = 0.01) = 0.5 "Sample time of the controller";
  parameter Real rate(unit = "1/s", min = 0) = 0.24 "Filling per second";
  parameter Real patience(unit = "s", min = 0) = 8 "Time without progress after which the bottle is rejected";
protected
  Integer idle(start = 0, fixed = true) "Ticks since the stage last changed or filling went on";
  Boolean feed(start = false, fixed = true);
  Boolean fill(start = false, fixed = true);
  Boolean cap(start = false, fixed = true);
  Boolean push(start = false, fixed = true);
  Boolean wrong(start = false, fixed = true) "The command does not fit the stage";
equation
  when sample(0, period) then
    feed = command == 1 and pre(stage) == 0;
    fill = command == 2 and (pre(stage) == 1 or pre(stage) == 2);
    // A fault: the cap is set whatever the level is.
    cap = command == 3 and pre(stage) == 2;
    push = command == 4 and pre(stage) == 3;
    // A held command is not wrong while the stage that it led to is still there.
    wrong = pre(stage) == 1 and (command == 3 or command == 4 or command == 5)
      or pre(stage) == 2 and (command == 1 or command == 4 or command == 5)
      or pre(stage) == 3 and (command == 1 or command == 2 or command == 5) or pre(idle) * period >= patience;
    stage = if feed then 1 elseif fill then 2 elseif cap then 3 elseif push or wrong then 0 else pre(stage);
    level = if fill then min(2, pre(level) + rate * period) elseif stage == 0 then 0 else pre(level);
    idle = if stage <> pre(stage) or fill or stage == 0 then 0 else pre(idle) + 1;
    boxed = if push then pre(boxed) + 1 else pre(boxed);
    underfilled = if push and pre(level) < 0.8 then pre(underfilled) + 1 else pre(underfilled);
    // Another fault: nothing stops the line when the nozzle is due for rinsing.
    sinceRinse = if command == 5 then 0 elseif push then pre(sinceRinse) + 1 else pre(sinceRinse);
  end when;
  // A tick at the end of a communication step is repeated with the next step's inputs, so it uses them without delay.
  annotation(
    experiment(StopTime = 60, Interval = 0.5),
    __falsifier_solver(method = "fixed", step = 0.5, repeatTicks = "always"));
end BottleLine;
