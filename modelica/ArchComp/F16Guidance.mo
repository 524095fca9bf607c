within ArchComp;
partial model F16Guidance "Ground-collision-avoidance autopilot of an F-16; how it sees the aircraft is left open"
  output Integer mode(start = Roll, fixed = true) "Autopilot: 0 stands by, 1 rolls the wings level, 2 pulls up";
protected
  constant Real fullTurn(unit = "rad") = 2 * 3.141592653589793;
  constant Real degree(unit = "rad") = fullTurn / 360;
  constant Integer StandBy = 0;
  constant Integer Roll = 1;
  constant Integer Pull = 2;
  constant Real samplePeriod(unit = "s") = 1 / 30;
  constant Integer pullTicksMin = 60 "Minimum duration of a pull in samples, 2 s";
  constant Real levelRoll(unit = "rad") = 5 * degree "The wings are level below this roll angle";
  constant Real levelRate(unit = "rad/s") = 10 * degree "and this roll rate";
  constant Real pullLoad = 5 "Load factor of the pull";
  constant Real floorAltitude(unit = "ft") = 1000 "Below this the autopilot starts again if the aircraft descends";

  function wrap "Angle relative to the nearest full turn"
    input Real angle(unit = "rad");
    output Real y(unit = "rad");
  algorithm
    y := angle - fullTurn * floor(angle / fullTurn + 0.5);
  end wrap;

  Real seenAltitude(unit = "ft") "Altitude that the autopilot sees";
  Real seenPath(unit = "rad") "Pitch angle less angle of attack";
  Real seenRoll(unit = "rad") "Roll angle";
  Real seenRollRate(unit = "rad/s") "Roll rate";
  Real rollError(unit = "rad") "Roll angle relative to the nearest level attitude";
  Real loadRequest "Load factor that the autopilot requests";
  Real rateRequest(unit = "rad/s") "Stability roll rate that the autopilot requests";
  Boolean climbing "Flight path points upwards";
  Boolean level "Wings are level and the roll has stopped";
  Integer pullTicks(start = 0, fixed = true) "Samples since the pull began";
equation
  // The mode changes only at samples, 30 per second. This sampling is essential to the benchmark: with exactly located
  // events instead, the altitude stays above 8.8 ft for every initial attitude in the box.
  rollError = wrap(seenRoll);
  when sample(0, samplePeriod) then
    climbing = wrap(seenPath) > 0;
    level = abs(seenRollRate) < levelRate and abs(rollError) < levelRoll;
    pullTicks = if pre(mode) == Pull then pre(pullTicks) + 1 else 0;
    mode = if pre(mode) == Roll then (if level then Pull else Roll)
      elseif pre(mode) == Pull then (if climbing and pullTicks >= pullTicksMin then StandBy else Pull)
      else (if not climbing and seenAltitude < floorAltitude then Roll else StandBy);
  end when;
  loadRequest = if mode == Pull then pullLoad else 0;
  rateRequest = if mode == Roll then -4 * rollError - 2 * seenRollRate else 0;
end F16Guidance;
