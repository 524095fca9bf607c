within ArchComp;
model AFC "Abstract fuel control of an engine: the driver's pedal opens the throttle, and a controller sampled every
10 ms sets the fuel so that the air/fuel ratio, which its sensor sees late, follows a reference: open loop (mode 1) at
first and at high power, else closed loop (mode 0); mu is the relative error of the measured ratio"
  import ArchComp.Tables.bilinear;

  input Real pedal(unit = "deg", min = 0, max = 81.2, start = 0) "Accelerator pedal: opens the throttle";
  input Real engine(unit = "rev/min", min = 900, max = 1100, start = 1000) "Engine speed";
  output Real mu(unit = "1") "Measured air/fuel ratio over its reference, minus 1; zero until measureTime";
  output Integer mode(start = 1, fixed = true, min = 0, max = 1) "0: closed loop, 1: open loop";

  parameter Real measureTime(unit = "s", min = 0) = 1 "From then on mu is measured";
  parameter Real faultTime(unit = "s", min = 0) = 60 "From then on the sensor of the air/fuel ratio is dead";
  parameter Integer warmUpTicks(min = 0) = 1000 "Ticks of 10 ms until the loop may be closed";
  parameter Real proportional(unit = "1") = 0.04 "Gain of the controller";
  parameter Real integral(unit = "1/s") = 0.14 "Gain of its integral part";
  parameter Real pumping(unit = "1") = 0.9 "Air that the cylinders take, as a share of what the controller reckons with";

  Real lag(unit = "deg", start = 0, fixed = true, nominal = 10) "Pedal as the throttle follows it";
  Real pressure(unit = "bar", start = 0.982, fixed = true) "Pressure in the intake manifold";
  Real film(unit = "g", start = 0.0112, fixed = true, nominal = 0.01) "Fuel on the wall of the intake";
  Real exhaust(unit = "1", start = 0, fixed = true) "Way of the exhaust gas in lengths of its pipe";
  Real mixed(unit = "1", start = 14.7, fixed = true, nominal = 10) "Air/fuel ratio at the sensor";
  Real measured(unit = "1", start = 14.7, fixed = true, nominal = 10) "Air/fuel ratio as the sensor sees it";
  Real fuel(unit = "g/s", start = 0.1726, fixed = true) "Fuel that is injected";

protected
  constant Real pi = 3.141592653589793;
  constant Real period(unit = "s") = 0.01;
  constant Real idle(unit = "deg") = 8.8 "Opening of the throttle at rest";
  constant Real filling(unit = "bar/g") = 0.41328;
  constant Real lean(unit = "1") = 14.7 "Reference of the air/fuel ratio";
  constant Real rich(unit = "1") = 12.5 "Reference at high power";
  constant Real powerOn(unit = "deg") = 70 "Above this opening of the throttle power is high";
  constant Real powerOff(unit = "deg") = 50 "Below this one it is not any more";
  // Rows: engine speed in rev/min; columns: air per stroke in g
  constant Real delaySpeed[5] = {800, 1000, 1500, 2000, 3000};
  constant Real delayAir[4] = {0.05, 0.15, 0.2, 0.25};
  constant Real delayTable[5, 4](each unit = "s") = {{0.8, 0.4, 0.3, 0.25}, {0.6, 0.3, 0.25, 0.2}, {0.4, 0.2, 0.2, 0.2},
    {0.3, 0.2, 0.2, 0.2}, {0.2, 0.2, 0.2, 0.2}} "Time that the exhaust gas takes to the sensor";
  constant Real wallSpeed[5] = {1000, 1500, 2000, 2500, 3000};
  constant Real wallAir[4] = {0.1, 0.2, 0.3, 0.4};
  constant Real directTable[5, 4] = {{0.8, 0.7, 0.66, 0.6}, {0.7, 0.66, 0.66, 0.6}, {0.7, 0.65, 0.63, 0.6},
    {0.8, 0.73, 0.66, 0.6}, {0.9, 0.85, 0.8, 0.7}} "Share of the fuel that does not meet the wall";
  constant Real dryingTable[5, 4](each unit = "s") = {{0.4, 0.22, 0.2, 0.35}, {0.3, 0.22, 0.22, 0.3},
    {0.35, 0.4, 0.5, 0.45}, {0.3, 0.35, 0.4, 0.5}, {0.2, 0.5, 0.35, 0.4}} "Time in which the wall dries";

  function throttleFlow "Air through the throttle in g/s"
    input Real opening "In deg";
    input Real p "Pressure behind the throttle in bar, before it is 1 bar";
    output Real rate;
  protected
    Real ratio = min(p, 1 / p);
    Real speed = 1 "Share of the speed of sound, as it were";
  algorithm
    if ratio >= 0.5 then
      speed := 2 * sqrt(max(0, ratio - ratio ^ 2));
    end if;
    rate := sign(1 - p) * speed * (2.821 + opening * (-0.05231 + opening * (0.10299 - 0.00063 * opening)));
  end throttleFlow;

  function pumpFlow "Air that the cylinders would take in g/s"
    input Real p "Pressure in the manifold in bar";
    input Real speed "Of the engine in rad/s";
    output Real rate;
  algorithm
    rate := -0.366 + 0.08979 * p * speed - 0.0337 * speed * p ^ 2 + 0.0001 * p * speed ^ 2;
  end pumpFlow;

  Real opening(unit = "deg") "Opening of the throttle";
  Real speed(unit = "rev/min") "Engine speed within its limits";
  Real turning(unit = "rad/s") "The same";
  Real inflow(unit = "g/s") "Air into the manifold";
  Real outflow(unit = "g/s") "Air into the cylinders";
  Real air(unit = "g") "Air per stroke";
  Real direct(unit = "1") "Share of the fuel that does not meet the wall";
  Real drying(unit = "s") "Time in which the wall dries";
  Real arriving(unit = "1") "Air/fuel ratio of the gas that arrives at the sensor";
  Real sensor(unit = "1") "Output of the sensor";
  // Controller; the original computes it in single precision, in which its clock has passed 10 s at tick 1000
  Integer ticks(start = 0, fixed = true);
  Boolean power(start = false, fixed = true) "Power is high";
  Boolean failed(start = false, fixed = true) "The sensor was found dead";
  Real reference(unit = "1", start = lean, fixed = true) "Reference of the air/fuel ratio";
  Real guess(unit = "bar", start = 0.982, fixed = true) "Pressure that the controller reckons with";
  Real reckoned(unit = "g/s", start = 0, fixed = true) "Air into the cylinders by that pressure";
  Real error(unit = "1", start = 0, fixed = true) "Measured ratio minus its reference";
  Real sum(unit = "1", start = 0, fixed = true) "Integral part";
  Real trim(unit = "1", start = 0, fixed = true) "Correction of the fuel by the closed loop";
equation
  speed = min(1100, max(900, engine));
  turning = speed * pi / 30;
  // Air
  der(lag) = (pedal - lag) / 0.1;
  opening = min(90, max(0, lag + idle));
  inflow = throttleFlow(opening, pressure);
  outflow = pumping * pumpFlow(pressure, turning);
  der(pressure) = filling * (inflow - outflow);
  air = pi * outflow / turning;
  // Fuel
  direct = bilinear(speed, air, wallSpeed, wallAir, directTable);
  drying = bilinear(speed, air, wallSpeed, wallAir, dryingTable);
  der(film) = (1 - direct) * fuel - film / drying;
  // Exhaust gas: its ratio arrives at the sensor when the gas has come through the pipe, which holds lean gas at first
  der(exhaust) = 1 / bilinear(speed, air, delaySpeed, delayAir, delayTable);
  (, arriving) = spatialDistribution(outflow / (direct * fuel + film / drying), 0, exhaust, true, {0, 1}, {lean, lean});
  der(mixed) = 10 * (arriving - mixed);
  der(measured) = 50 * (mixed - measured);
  sensor = if time < faultTime then measured else -1;
  mu = if time < measureTime then 0 else measured / reference - 1;
algorithm
  when sample(period, period) then
    ticks := pre(ticks) + 1;
    power := opening >= (if pre(power) then powerOff else powerOn);
    failed := pre(failed) or sensor <= -1;
    mode := if failed or ticks < warmUpTicks or power then 1 else 0;
    reference := if power and ticks >= warmUpTicks then rich else lean;
    reckoned := pumpFlow(pre(guess), turning);
    guess := pre(guess) + filling * (inflow - reckoned) * period;
    if mode == 0 then
      error := sensor - reference;
      sum := pre(sum) + integral * error * period;
      trim := proportional * error + sum;
    end if;
    fuel := min(1.66, max(0.13, reckoned / reference * (if mode == 1 then 1 else max(0, 1 + trim))));
  end when;
  // A tick at the end of a communication step is repeated with the inputs that follow: it sees them without delay.
  annotation(
    experiment(StopTime = 50, Interval = 0.01, Tolerance = 1e-6),
    __falsifier_solver(method = "implicit", repeatTicks = "always"));
end AFC;
