within ArchComp;
model AT "Car with an engine, a torque converter and a four-speed automatic transmission: the driver's throttle and
brake determine engine speed, vehicle speed and gear; a shift schedule selects the gear every 0.04 s"
  import ArchComp.Tables.linear;
  import ArchComp.Tables.bilinear;

  input Real throttle(unit = "%", min = 0, max = 100, start = 0) "Throttle opening: 0 closed, 100 fully open";
  input Real brake(unit = "ft.lbf", min = 0, max = 325, start = 0) "Brake torque at the wheels";
  output Real speed(unit = "mph", min = -10, max = 250) "Vehicle speed";
  output Real rpm(unit = "rev/min", min = 0, max = 6000) "Engine speed";
  output Integer gear(start = 1, min = 1, max = 4) "Gear of the transmission, 1 is the lowest";

  parameter Real engineInertia(unit = "ft.lbf.min/s", min = 1e-6) = 0.021991488283555904
    "Inertia of engine and impeller: torque per change of engine speed";
  parameter Real vehicleInertia(unit = "ft.lbf.min/s", min = 1e-6) = 12.094147857312473
    "Inertia of the vehicle: torque per change of wheel speed";
  parameter Real finalDrive(unit = "1", min = 0.1) = 3.23 "Ratio of the final drive";
  parameter Real wheelRadius(unit = "ft", min = 0.1) = 1.0 "Radius of the wheels";
  parameter Real rollingLoad(unit = "ft.lbf", min = 0) = 40.0 "Load torque that does not depend on speed";
  parameter Real airLoad(unit = "ft.lbf/mph2", min = 0) = 0.02 "Load torque per square of the vehicle speed";
  parameter Integer waitTicks(min = 0) = 2 "Number of 0.04 s ticks for which a threshold must stay crossed before a shift";

protected
  constant Real pi = 3.141592653589793;
  constant Real gearRatio[4] = {2.393, 1.450, 1.000, 0.677};
  constant Real engineThrottle[10] = {0, 20, 30, 40, 50, 60, 70, 80, 90, 100};
  constant Real engineSpeed[11] = {800, 1200, 1600, 2000, 2400, 2800, 3200, 3600, 4000, 4400, 4800};
  constant Real engineTorqueMap[10, 11] = [
    -40, -44, -49, -53, -57, -61, -65, -70, -74, -78, -82;
    215, 117, 85, 66, 44, 29, 10, -2, -13, -22, -32;
    245, 208, 178, 148, 122, 104, 85, 66, 48, 33, 18;
    264, 260, 241, 219, 193, 167, 152, 133, 119, 96, 85;
    264, 279, 282, 275, 260, 238, 223, 208, 189, 171, 152;
    267, 290, 293, 297, 290, 275, 260, 256, 234, 212, 193;
    267, 297, 305, 305, 305, 301, 293, 282, 267, 249, 226;
    267, 301, 308, 312, 319, 323, 319, 316, 297, 279, 253;
    267, 301, 312, 319, 327, 327, 327, 327, 312, 293, 267;
    267, 301, 312, 319, 327, 334, 334, 334, 319, 305, 275];
  constant Real speedRatio[21] = {0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.81, 0.82, 0.83, 0.84, 0.85, 0.86, 0.87,
    0.88, 0.89, 0.9, 0.92, 0.94};
  constant Real capacity[21] = {137.4652089938063, 137.06501915685197, 135.86444964598905, 135.6643547275119,
    137.56525645304487, 140.3665853117251, 145.2689108144154, 152.87251771654735, 162.97731109964374,
    164.2779280697452, 166.17882979527823, 167.97968406157264, 170.08068070558275, 172.78196210502438,
    175.3831960452274, 179.58518933324765, 183.58708770279083, 189.8900776348212, 197.69377945543027,
    215.90241703685155, 244.51599037908485};
  constant Real torqueRatio[21] = {2.232, 2.075, 1.975, 1.846, 1.72, 1.564, 1.409, 1.254, 1.096, 1.08, 1.061, 1.043,
    1.028, 1.012, 1.002, 1.002, 1.001, 0.998, 0.999, 1.001, 1.002};
  constant Real gears[4] = {1, 2, 3, 4};
  constant Real upThrottle[6] = {0, 25, 35, 50, 90, 100};
  constant Real upSpeed[6, 4] = [10, 30, 50, 1e6; 10, 30, 50, 1e6; 15, 30, 50, 1e6; 23, 41, 60, 1e6; 40, 70, 100, 1e6;
    40, 70, 100, 1e6];
  constant Real downThrottle[6] = {0, 5, 40, 50, 90, 100};
  constant Real downSpeed[6, 4] = [0, 5, 20, 35; 0, 5, 20, 35; 0, 5, 25, 40; 0, 5, 30, 50; 0, 30, 50, 80; 0, 30, 50, 80];
  constant Real lowestRpm = 600;
  constant Real highestRpm = 6000;
  constant Real creep(unit = "mph") = 0.01 "Below this speed the load falls to zero, so that the brake can hold the car";

  Real engine(unit = "rev/min", start = 1000, fixed = true, nominal = 1000) "Engine speed";
  Real wheel(unit = "rev/min", start = 0, fixed = true, nominal = 100) "Wheel speed";
  Real slip(unit = "1") "Speed ratio of the torque converter";
  Real impeller(unit = "ft.lbf") "Torque that the torque converter takes from the engine";
  Real drive(unit = "ft.lbf") "Torque of the transmission";
  Real load(unit = "ft.lbf") "Load torque at the wheels, opposing the motion";
  Real surplus(unit = "rev/min/s") "Rate of change of engine speed while no limit is reached";
  Real ratio(unit = "1") "Ratio of the gear";
  Integer region(start = 0) "Shift chart: 0 steady, 1 waiting to shift up, 2 waiting to shift down";
  Integer ticks(start = 0) "Ticks since the last change of region";
  Boolean started(start = false) "The chart is entered at the first tick and active from the second one";
  Real up(unit = "mph", start = 0) "Speed above which a higher gear is selected";
  Real down(unit = "mph", start = 0) "Speed below which a lower gear is selected";
equation
  speed = 2 * pi * wheelRadius * 60 / 5280 * wheel;
  rpm = engine;
  ratio = gearRatio[gear];
  slip = ratio * finalDrive * wheel / engine;
  impeller = (engine / linear(slip, speedRatio, capacity)) ^ 2;
  drive = ratio * impeller * linear(slip, speedRatio, torqueRatio);
  load = noEvent(min(1, max(-1, speed / creep))) * (rollingLoad + airLoad * speed ^ 2 + brake);
  surplus = (bilinear(throttle, engine, engineThrottle, engineSpeed, engineTorqueMap) - impeller) / engineInertia;
  der(engine) = if engine >= highestRpm and surplus > 0 or engine <= lowestRpm and surplus < 0 then 0 else surplus;
  der(wheel) = (finalDrive * drive - load) / vehicleInertia;
algorithm
  when sample(0, 0.04) then
    if pre(started) then
      ticks := pre(ticks) + 1;
      up := bilinear(throttle, pre(gear), upThrottle, gears, upSpeed);
      down := bilinear(throttle, pre(gear), downThrottle, gears, downSpeed);
      if pre(region) == 0 then
        if speed > up then
          region := 1;
          ticks := 0;
        elseif speed < down then
          region := 2;
          ticks := 0;
        end if;
      elseif pre(region) == 1 then
        if ticks >= waitTicks and speed >= up then
          gear := min(4, pre(gear) + 1);
          region := 0;
        elseif speed < up then
          region := 0;
        end if;
      else
        if ticks >= waitTicks and speed <= down then
          gear := max(1, pre(gear) - 1);
          region := 0;
        elseif speed > down then
          region := 0;
        end if;
      end if;
    end if;
    started := true;
  end when;
  annotation(
    experiment(StartTime = 0, StopTime = 50, Interval = 0.01, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.01));
end AT;
