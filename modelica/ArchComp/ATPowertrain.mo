within ArchComp;
partial model ATPowertrain "Engine, torque converter, transmission and vehicle; what selects the gear determines its ratio"
  import ArchComp.Tables.linear;
  import ArchComp.Tables.bilinear;

  input Real throttle(unit = "%", min = 0, max = 100, start = 0) "Throttle opening: 0 closed, 100 fully open";
  input Real brake(unit = "ft.lbf", min = 0, max = 325, start = 0) "Brake torque at the wheels";
  output Real speed(unit = "mph", min = -10, max = 250) "Vehicle speed";
  output Real rpm(unit = "rev/min", min = 0, max = 6000) "Engine speed";
  parameter Real engineInertia(unit = "ft.lbf.min/s", min = 1e-6) = 0.021991488283555904
    "Inertia of engine and impeller: torque per change of engine speed";
  parameter Real vehicleInertia(unit = "ft.lbf.min/s", min = 1e-6) = 12.094147857312473
    "Inertia of the vehicle: torque per change of wheel speed";
  parameter Real finalDrive(unit = "1", min = 0.1) = 3.23 "Ratio of the final drive";
  parameter Real wheelRadius(unit = "ft", min = 0.1) = 1.0 "Radius of the wheels";
  parameter Real rollingLoad(unit = "ft.lbf", min = 0) = 40.0 "Load torque that does not depend on speed";
  parameter Real airLoad(unit = "ft.lbf/mph2", min = 0) = 0.02 "Load torque per square of the vehicle speed";

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
equation
  speed = 2 * pi * wheelRadius * 60 / 5280 * wheel;
  rpm = engine;
  slip = ratio * finalDrive * wheel / engine;
  impeller = (engine / linear(slip, speedRatio, capacity)) ^ 2;
  drive = ratio * impeller * linear(slip, speedRatio, torqueRatio);
  load = noEvent(min(1, max(-1, speed / creep))) * (rollingLoad + airLoad * speed ^ 2 + brake);
  surplus = (bilinear(throttle, engine, engineThrottle, engineSpeed, engineTorqueMap) - impeller) / engineInertia;
  der(engine) = if engine >= highestRpm and surplus > 0 or engine <= lowestRpm and surplus < 0 then 0 else surplus;
  der(wheel) = (finalDrive * drive - load) / vehicleInertia;
end ATPowertrain;
