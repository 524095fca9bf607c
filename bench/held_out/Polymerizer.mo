model Polymerizer "Stirred tank in which a monomer becomes a polymer. Radicals start and end the reaction within milliseconds, the tank
heats up within minutes. Above a temperature an inhibitor is injected, which ends the reaction for a while; a thick content is
stirred badly and gives its heat off slowly"
  input Real coolant(unit = "K", min = 280, max = 345, start = 310) "Temperature of the jacket";
  input Real feed(unit = "1/s", min = 0, max = 0.02, start = 0.005) "Feed of fresh monomer";
  input Integer starter(min = 0, max = 3, start = 1) "Setting of the starter's valve";
  output Real monomer(unit = "1", start = 0.5, fixed = true, min = 0) "Concentration of the monomer";
  output Real polymer(unit = "1", start = 0.1, fixed = true, min = 0) "Concentration of the polymer";
  output Real temperature(unit = "K", start = 310, fixed = true, nominal = 100) "Temperature in the tank";
  output Boolean inhibited(start = false, fixed = true) "Inhibitor is in the tank";
  output Integer injections(start = 0, fixed = true, min = 0) "Injections of inhibitor";
protected
  Real radicals(start = 0.1, fixed = true) "Concentration of the radicals, scaled";
  Integer ticks(start = 0, fixed = true) "Seconds for which the inhibitor still acts";
equation
  der(radicals) = 1000 * ((0.2 + starter) * exp(14 - 4800 / temperature) - (if inhibited then 20 else 1) * radicals * (1 + radicals));
  der(monomer) = feed * (1.2 - monomer) - 0.03 * radicals * monomer;
  der(polymer) = 0.03 * radicals * monomer - feed * polymer;
  der(temperature) = 3 * radicals * monomer - (temperature - coolant) / (20 * (1 + 4 * polymer ^ 2)) - feed * (temperature - 300);
  when sample(0, 1) then
    injections = if temperature > 385 and not pre(inhibited) then pre(injections) + 1 else pre(injections);
    ticks = if injections > pre(injections) then 60 else max(0, pre(ticks) - 1);
    inhibited = ticks > 0;
  end when;
  annotation(
    experiment(StopTime = 600, Interval = 1, Tolerance = 1e-6),
    __falsifier_solver(method = "implicit", repeatTicks = "always"));
end Polymerizer;
