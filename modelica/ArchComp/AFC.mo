within ArchComp;
model AFC "Abstract fuel control of an engine: the driver's pedal opens the throttle; every 10 ms a controller sets the
fuel rate so that the air/fuel ratio, which is measured with a delay, follows a reference. It works in open loop (mode 1)
during the first 10 s and at high power, otherwise in closed loop (mode 0). mu is the relative error of the measured ratio"
  import ArchComp.Tables.bilinear;

  input Real pedal(unit = "deg", min = 0, max = 81.2, start = 0) "Angle of the accelerator pedal, which opens the throttle";
  input Real engine(unit = "rev/min", min = 900, max = 1100, start = 1000) "Engine speed";
  output Real mu(unit = "1") "Relative error of the measured air/fuel ratio: ratio / reference - 1; zero before measureTime";
  output Integer mode(start = 1, fixed = true, min = 0, max = 1) "Controller mode: 0 closed loop, 1 open loop";

  parameter Real measureTime(unit = "s", min = 0) = 1 "Time from which mu is computed";
  parameter Real faultTime(unit = "s", min = 0) = 60 "Time at which the air/fuel sensor fails";
  parameter Integer warmUpTicks(min = 0) = 1000 "Number of 10 ms ticks before the loop can be closed";
  parameter Real proportional(unit = "1") = 0.04 "Proportional gain of the controller";
  parameter Real integral(unit = "1/s") = 0.14 "Integral gain of the controller";
  parameter Real pumping(unit = "1") = 0.9 "Actual air flow into the cylinders, relative to the controller's model of it";

  Real lag(unit = "deg", start = 0, fixed = true, nominal = 10) "Pedal angle, filtered by the lag of the throttle";
  Real pressure(unit = "bar", start = 0.982, fixed = true) "Pressure in the intake manifold";
  Real film(unit = "g", start = 0.0112, fixed = true, nominal = 0.01) "Fuel film on the wall of the intake";
  Real exhaust(unit = "1", start = 0, fixed = true) "Distance travelled by the exhaust gas, in lengths of its pipe";
  Real mixed(unit = "1", start = 14.7, fixed = true, nominal = 10) "Air/fuel ratio at the sensor";
  Real measured(unit = "1", start = 14.7, fixed = true, nominal = 10) "Air/fuel ratio, filtered by the lag of the sensor";
  Real fuel(unit = "g/s", start = 0.1726, fixed = true) "Injected fuel";

protected
  constant Real pi = 3.141592653589793;
  constant Real period(unit = "s") = 0.01;
  constant Real idle(unit = "deg") = 8.8 "Throttle opening at rest";
  constant Real filling(unit = "bar/g") = 0.41328;
  constant Real lean(unit = "1") = 14.7 "Reference of the air/fuel ratio at normal power";
  constant Real rich(unit = "1") = 12.5 "Reference at high power";
  constant Real powerOn(unit = "deg") = 70 "Throttle opening above which high power begins";
  constant Real powerOff(unit = "deg") = 50 "Throttle opening below which it ends";
  // Rows: engine speed in rev/min; columns: air per stroke in g
  constant Real delaySpeed[5] = {800, 1000, 1500, 2000, 3000};
  constant Real delayAir[4] = {0.05, 0.15, 0.2, 0.25};
  constant Real delayTable[5, 4](each unit = "s") = {{0.8, 0.4, 0.3, 0.25}, {0.6, 0.3, 0.25, 0.2}, {0.4, 0.2, 0.2, 0.2},
    {0.3, 0.2, 0.2, 0.2}, {0.2, 0.2, 0.2, 0.2}} "Transport time of the exhaust gas to the sensor";
  constant Real wallSpeed[5] = {1000, 1500, 2000, 2500, 3000};
  constant Real wallAir[4] = {0.1, 0.2, 0.3, 0.4};
  constant Real directTable[5, 4] = {{0.8, 0.7, 0.66, 0.6}, {0.7, 0.66, 0.66, 0.6}, {0.7, 0.65, 0.63, 0.6},
    {0.8, 0.73, 0.66, 0.6}, {0.9, 0.85, 0.8, 0.7}} "Fraction of the fuel that does not hit the wall";
  constant Real dryingTable[5, 4](each unit = "s") = {{0.4, 0.22, 0.2, 0.35}, {0.3, 0.22, 0.22, 0.3},
    {0.35, 0.4, 0.5, 0.45}, {0.3, 0.35, 0.4, 0.5}, {0.2, 0.5, 0.35, 0.4}} "Time constant with which the film evaporates";

  function throttleFlow "Air through the throttle in g/s"
    input Real opening "Throttle opening in deg";
    input Real p "Pressure behind the throttle in bar; in front of it the pressure is 1 bar";
    output Real rate;
  protected
    Real ratio = min(p, 1 / p);
    Real speed = 1 "Flow speed relative to the speed of sound";
  algorithm
    if ratio >= 0.5 then
      speed := 2 * sqrt(max(0, ratio - ratio ^ 2));
    end if;
    rate := sign(1 - p) * speed * (2.821 + opening * (-0.05231 + opening * (0.10299 - 0.00063 * opening)));
  end throttleFlow;

  function pumpFlow "Air flow into the cylinders in g/s, according to the controller's model"
    input Real p "Pressure in the manifold in bar";
    input Real speed "Engine speed in rad/s";
    output Real rate;
  algorithm
    rate := -0.366 + 0.08979 * p * speed - 0.0337 * speed * p ^ 2 + 0.0001 * p * speed ^ 2;
  end pumpFlow;

  Real opening(unit = "deg") "Throttle opening";
  Real speed(unit = "rev/min") "Engine speed, limited";
  Real turning(unit = "rad/s") "Engine speed, limited, in rad/s";
  Real inflow(unit = "g/s") "Air flow into the manifold";
  Real outflow(unit = "g/s") "Air flow into the cylinders";
  Real air(unit = "g") "Air per stroke";
  Real direct(unit = "1") "Fraction of the fuel that does not hit the wall";
  Real drying(unit = "s") "Time constant with which the film evaporates";
  Real arriving(unit = "1") "Air/fuel ratio of the gas arriving at the sensor";
  Real sensor(unit = "1") "Output of the sensor";
  // Controller; the original uses single precision, in which its clock exceeds 10 s at tick 1000
  Integer ticks(start = 0, fixed = true);
  Boolean power(start = false, fixed = true) "High power";
  Boolean failed(start = false, fixed = true) "A failure of the sensor was detected";
  Real reference(unit = "1", start = lean, fixed = true) "Current reference of the air/fuel ratio";
  Real guess(unit = "bar", start = 0.982, fixed = true) "Manifold pressure, estimated by the controller";
  Real estimate(unit = "g/s", start = 0, fixed = true) "Air flow into the cylinders at that pressure";
  Real error(unit = "1", start = 0, fixed = true) "Measured ratio minus its reference";
  Real sum(unit = "1", start = 0, fixed = true) "Integral term";
  Real trim(unit = "1", start = 0, fixed = true) "Fuel correction of the closed loop";
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
  // Exhaust gas: its ratio reaches the sensor when the gas has passed the pipe, which is filled with lean gas at the start
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
    estimate := pumpFlow(pre(guess), turning);
    guess := pre(guess) + filling * (inflow - estimate) * period;
    if mode == 0 then
      error := sensor - reference;
      sum := pre(sum) + integral * error * period;
      trim := proportional * error + sum;
    end if;
    fuel := min(1.66, max(0.13, estimate / reference * (if mode == 1 then 1 else max(0, 1 + trim))));
  end when;
  // A tick at the end of a communication step is repeated with the next step's inputs, so it uses them without delay.
  annotation(
    experiment(StopTime = 50, Interval = 0.01, Tolerance = 1e-6),
    __falsifier_solver(method = "implicit", repeatTicks = "always"));
end AFC;
