within Faults;
model ChargerHandshake "Charging station for electric cars. The car sends commands: lock the plug, precharge the bus to
the battery voltage, close the contactors. Each must follow the previous one within a time limit, otherwise the station
returns to idle. The contactors must not be closed while the plug is unlocked"
  type Command = enumeration(
    Wait "No command",
    Lock "Lock the plug",
    Unlock "Unlock the plug",
    Precharge "Charge the bus, as long as this is commanded",
    Close "Close the contactors",
    Open "Open the contactors and stop",
    Reset "Return to idle") "Command of the car";
  type Phase = enumeration(
    Idle "Nothing is connected",
    Locked "The plug is locked",
    Precharging "The bus is being charged",
    Ready "The bus has reached the battery voltage",
    Charging "The contactors are closed") "State of the station";
  input Command command(start = Command.Wait) "Command of the car";
  output Phase phase(start = Phase.Idle, fixed = true) "State of the station";
  output Boolean locked(start = false, fixed = true) "The plug is locked";
  output Boolean closed(start = false, fixed = true) "The contactors are closed";
  output Real voltage(unit = "V", start = 0, fixed = true, nominal = 100, min = 0) "Bus voltage";
  parameter Real period(unit = "s", min = 0.001) = 0.1 "Sample time of the controller";
  parameter Real battery(unit = "V", min = 0) = 400 "Battery voltage of the car";
  parameter Real rise(unit = "s", min = 0.001) = 0.8 "Time constant of precharging the bus";
  parameter Real fall(unit = "s", min = 0.001) = 0.5 "Time constant of discharging the bus";
  parameter Real lockTime(unit = "s", min = 0) = 2.5 "Maximum time from locking to the start of precharging";
  parameter Real prechargeTime(unit = "s", min = 0) = 4 "Maximum time of precharging";
  parameter Real readyTime(unit = "s", min = 0) = 2 "Maximum time from the end of precharging to closing the contactors";
protected
  Integer ticks(start = 0, fixed = true) "Ticks since the phase was entered";
  Boolean late(start = false, fixed = true) "The time limit of the phase is exceeded";
  Boolean stop(start = false, fixed = true) "The station returns to idle";
equation
  der(voltage) = if phase == Phase.Precharging or phase == Phase.Ready or phase == Phase.Charging
    then (battery - voltage) / rise else -voltage / fall;
  when sample(0, period) then
    late = (pre(ticks) + 0.5) * period > (if pre(phase) == Phase.Locked then lockTime
      elseif pre(phase) == Phase.Precharging then prechargeTime
      elseif pre(phase) == Phase.Ready then readyTime else 1e6);
    // The fault: unlocking the plug does not stop the station if it is ready.
    stop = late or command == Command.Open or command == Command.Reset
      or command == Command.Unlock and (pre(phase) == Phase.Locked or pre(phase) == Phase.Precharging)
      or pre(phase) == Phase.Precharging and command <> Command.Precharge;
    phase = if stop then Phase.Idle
      elseif pre(phase) == Phase.Idle and command == Command.Lock then Phase.Locked
      elseif pre(phase) == Phase.Locked and command == Command.Precharge then Phase.Precharging
      elseif pre(phase) == Phase.Precharging and voltage >= 0.95 * battery then Phase.Ready
      elseif pre(phase) == Phase.Ready and command == Command.Close then Phase.Charging
      else pre(phase);
    ticks = if phase == pre(phase) then pre(ticks) + 1 else 0;
    closed = phase == Phase.Charging;
    locked = if stop or command == Command.Unlock and not closed then false
      elseif command == Command.Lock and phase == Phase.Locked then true else pre(locked);
  end when;
  // A tick at the end of a communication step is repeated with the next step's inputs, so it uses them without delay.
  annotation(
    experiment(StopTime = 16, Interval = 0.1, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.1, repeatTicks = "always"));
end ChargerHandshake;
