within ArchComp;
model ATCar "Car with an engine, a torque converter and a four-speed transmission, as a component of its own: throttle, brake and
gear determine engine speed and vehicle speed"
  extends ATPowertrain;
  input Integer gear(start = 1, min = 1, max = 4) "Gear of the transmission, 1 is the lowest";
  output Real throttlePosition(unit = "%", min = 0, max = 100) "Throttle opening, as a sensor tells the shift logic";
equation
  throttlePosition = throttle;
  ratio = gearRatio[gear];
  annotation(
    experiment(StartTime = 0, StopTime = 50, Interval = 0.01, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.01));
end ATCar;
