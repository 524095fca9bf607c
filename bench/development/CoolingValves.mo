model CoolingValves "Cooling water of a hall with twenty valves. Valve 7 cools a furnace door, through a long pipe back to the
tank; valve 13 lets fresh water into the tank. The other valves only lower the pressure a little. A relief valve
protects the pump: while much water flows and little is fresh, it drains the water of the door instead of returning it"
  input Real v1(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 1";
  input Real v2(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 2";
  input Real v3(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 3";
  input Real v4(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 4";
  input Real v5(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 5";
  input Real v6(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 6";
  input Real v7(unit = "1", min = 0, max = 1, start = 0.5) "Opening of the valve of the furnace door";
  input Real v8(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 8";
  input Real v9(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 9";
  input Real v10(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 10";
  input Real v11(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 11";
  input Real v12(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 12";
  input Real v13(unit = "1", min = 0, max = 1, start = 0.5) "Opening of the valve for fresh water";
  input Real v14(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 14";
  input Real v15(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 15";
  input Real v16(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 16";
  input Real v17(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 17";
  input Real v18(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 18";
  input Real v19(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 19";
  input Real v20(unit = "1", min = 0, max = 1, start = 0.5) "Opening of valve 20";
  output Real door(unit = "degC", start = 110, fixed = true, nominal = 100) "Temperature of the furnace door";
  output Real supply(unit = "degC", start = 20, fixed = true, nominal = 10) "Temperature of the water in the tank";
  output Real water(unit = "1", min = 0) "Flow through the door, as a share of the largest";
  output Boolean relieved(start = false, fixed = true) "The relief valve is open";
  parameter Real transport(unit = "s", min = 0.1) = 12 "Time that the water takes from the door to the tank";
protected
  Real pressure "As a share of the largest";
  Real back "Temperature of the water that leaves the door";
  Real arriving "Heat that arrives at the tank";
equation
  pressure = 1 - 0.005 * (v1 + v2 + v3 + v4 + v5 + v6 + v8 + v9 + v10 + v11 + v12 + v14 + v15 + v16 + v17 + v18 + v19 + v20);
  water = v7 * pressure;
  der(door) = 6 - 0.08 * water * (door - supply);
  back = supply + 0.5 * (door - supply);
  arriving = delay(if relieved then 0 else water * (back - supply), transport);
  der(supply) = arriving / 12 - (0.005 + 0.1 * v13) * (supply - 15);
  when sample(0, 0.5) then
    relieved = v7 > 0.5 and v13 < 0.1 or pre(relieved) and v7 > 0.4;
  end when;
  annotation(
    experiment(StopTime = 90, Interval = 0.5, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.25, repeatTicks = "always", delayPoints = 512));
end CoolingValves;
