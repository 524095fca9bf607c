within ArchComp;
model CCCar "A following one of the chasing cars, as a component of its own: it keeps, chases or brakes, depending on its
gap to the car ahead"
  input Real ahead(unit = "m", start = 0, min = -1e6, max = 1e6) "Position of the car ahead";
  output Real y(unit = "m", start = 10, fixed = true) "Position of the car";
  output Real gap(unit = "m") "Distance to the car ahead";
  output Integer mode(start = 1, fixed = true, min = 1, max = 3) "1 keeping, 2 chasing, 3 braking";
  parameter Real chaseAt(unit = "m") = 15 "Gap at which a keeping car starts to chase";
  parameter Real keepAt(unit = "m") = 10 "Gap at which a chasing car starts to keep";
  parameter Real brakeAt(unit = "m") = 5 "Gap at which a keeping car starts to brake";
  parameter Real releaseAt(unit = "m") = 20 "Gap at which a braking car starts to chase";
  Real v(unit = "m/s", start = 0, fixed = true) "Speed, which increases while the car chases";
protected
  constant Real far(unit = "m") = 1e9 "A gap that no car reaches";
  Real upper(unit = "m") "Gap above which the current mode ends";
  Real lower(unit = "m") "Gap below which the current mode ends";
equation
  gap = y - ahead;
  der(y) = if mode == 1 then v else -v;
  der(v) = if mode == 2 then 1 elseif mode == 3 then -v else 0;
  upper = if pre(mode) == 1 then chaseAt elseif pre(mode) == 3 then releaseAt else far;
  lower = if pre(mode) == 1 then brakeAt elseif pre(mode) == 2 then keepAt else -far;
  when gap >= upper then
    mode = 2;
  elsewhen gap <= lower then
    mode = if pre(mode) == 1 then 3 else 1;
  end when;
  annotation(
    experiment(StopTime = 100, Interval = 0.01, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.01));
end CCCar;
