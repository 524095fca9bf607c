within ArchComp;
model CCFollower "A following car: keeps, chases or brakes depending on its
gap to the car ahead; changes of mode are located as state events"
  constant Integer Keeping = 1 "Drifts away from the car ahead at constant speed";
  constant Integer Chasing = 2 "Closes the gap with increasing speed";
  constant Integer Braking = 3 "Closes the gap with decreasing speed";
  parameter Real chaseAt(unit = "m") = 15 "Gap at which a keeping car starts to chase";
  parameter Real keepAt(unit = "m") = 10 "Gap at which a chasing car starts to keep";
  parameter Real brakeAt(unit = "m") = 5 "Gap at which a keeping car starts to brake";
  parameter Real releaseAt(unit = "m") = 20 "Gap at which a braking car starts to chase";
  input Real ahead(unit = "m") "Position of the car ahead";
  Real y(unit = "m", fixed = true) "Position";
  Real v(unit = "m/s", start = 0, fixed = true) "Speed, which increases while the car chases";
  Real gap(unit = "m") "Distance to the car ahead";
  Integer mode(start = Keeping, fixed = true) "1 keeping, 2 chasing, 3 braking";
protected
  constant Real far(unit = "m") = 1e9 "A gap that no car reaches";
  Real upper(unit = "m") "Gap above which the current mode ends";
  Real lower(unit = "m") "Gap below which the current mode ends";
equation
  gap = y - ahead;
  // Signs as in the original: a keeping car moves away from the one ahead (+v); in the other modes it moves towards it.
  der(y) = if mode == Keeping then v else -v;
  der(v) = if mode == Chasing then 1 elseif mode == Braking then -v else 0;
  upper = if pre(mode) == Keeping then chaseAt elseif pre(mode) == Braking then releaseAt else far;
  lower = if pre(mode) == Keeping then brakeAt elseif pre(mode) == Chasing then keepAt else -far;
  when gap >= upper then
    mode = Chasing;
  elsewhen gap <= lower then
    mode = if pre(mode) == Keeping then Braking else Keeping;
  end when;
end CCFollower;
