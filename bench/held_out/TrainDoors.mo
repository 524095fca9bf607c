model TrainDoors "Doors of a train. The driver releases them, a passenger's button opens them, and they close after a while unless
something is in the way, when they open again. After three such attempts they wait for the driver. The brake is held while a door is
open; the train may leave when the doors have been closed for some time"
  input Boolean release(start = false) "The driver releases the doors";
  input Boolean button(start = false) "A passenger presses the button";
  input Boolean obstacle(start = false) "Something is in the way of a door";
  input Real throttle(unit = "1", min = -1, max = 1, start = 0) "Wanted acceleration, as a share of the largest";
  output Real speed(unit = "m/s", start = 0, fixed = true, min = 0) "Speed of the train";
  output Real opening(unit = "1", start = 0, fixed = true, min = 0, max = 1) "How far the doors are open";
  output Integer state(start = 0, fixed = true, min = 0, max = 4) "0 closed, 1 opening, 2 open, 3 closing, 4 waiting for the driver";
  output Integer attempts(start = 0, fixed = true, min = 0) "Attempts to close that something stopped";
  output Boolean held(start = false, fixed = true) "The brake is held";
  parameter Real period(unit = "s", min = 0.01) = 0.5 "Sample time of the controller";
  parameter Real staying(unit = "s", min = 0) = 5 "Time for which the doors stay open";
protected
  Integer ticks(start = 0, fixed = true) "Ticks since the state was entered";
  Integer closedTicks(start = 20, fixed = true) "Ticks for which the doors have been closed";
  Boolean blocked(start = false, fixed = true) "Something stops the doors";
equation
  der(speed) = if held then (if speed > 0 then -1.5 else 0) elseif speed > 0 or throttle > 0 then throttle - 0.02 * speed else 0;
  when sample(0, period) then
    blocked = pre(state) == 3 and obstacle;
    state = if pre(state) == 0 and release and button and speed < 0.5 then 1
      elseif pre(state) == 1 and pre(opening) >= 0.99 then 2
      elseif pre(state) == 2 and pre(ticks) * period >= staying and not button then 3
      elseif blocked then (if pre(attempts) >= 2 then 4 else 1)
      elseif pre(state) == 3 and pre(opening) <= 0.01 then 0
      elseif pre(state) == 4 and release then 3 else pre(state);
    ticks = if state <> pre(state) then 0 else pre(ticks) + 1;
    attempts = if blocked then pre(attempts) + 1 elseif state == 0 then 0 else pre(attempts);
    opening = if state == 1 then min(1, pre(opening) + 0.25) elseif state == 3 then max(0, pre(opening) - 0.25) else pre(opening);
    closedTicks = if state == 0 then pre(closedTicks) + 1 else 0;
    // The fault: doors that wait for the driver do not hold the brake.
    held = state == 1 or state == 2 or state == 3 or state == 0 and closedTicks * period < 2;
  end when;
  // A tick at the end of a communication step is repeated with the next step's inputs, so it uses them without delay.
  annotation(
    experiment(StopTime = 120, Interval = 0.5, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.25, repeatTicks = "always"));
end TrainDoors;
