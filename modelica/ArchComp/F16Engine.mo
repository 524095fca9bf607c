within ArchComp;
package F16Engine "Thrust and power lag of the F-16's engine (Stevens
and Lewis); power is 0 to 100 percent, with military power at 50"
  constant Real machs[6] = {0, 0.2, 0.4, 0.6, 0.8, 1};
  constant Real altitudes[6](each unit = "ft") = {0, 10000, 20000, 30000, 40000, 50000};
  // Thrust in lbf; rows: Mach number, columns: altitude
  constant Real idle[6, 6] = {
    {1060, 670, 880, 1140, 1500, 1860},
    {635, 425, 690, 1010, 1330, 1700},
    {60, 25, 345, 755, 1130, 1525},
    {-1020, -170, -300, 350, 910, 1360},
    {-2700, -1900, -1300, -247, 600, 1100},
    {-3600, -1400, -595, -342, -200, 700}};
  constant Real military[6, 6] = {
    {12680, 9150, 6200, 3950, 2450, 1400},
    {12680, 9150, 6313, 4040, 2470, 1400},
    {12610, 9312, 6610, 4290, 2600, 1560},
    {12640, 9839, 7090, 4660, 2840, 1660},
    {12390, 10176, 7750, 5320, 3250, 1930},
    {11680, 9848, 8050, 6100, 3800, 2310}};
  constant Real maximum[6, 6] = {
    {20000, 15000, 10800, 7000, 4000, 2500},
    {21420, 15700, 11225, 7323, 4435, 2600},
    {22700, 16860, 12250, 8154, 5000, 2835},
    {24240, 18910, 13760, 9285, 5700, 3215},
    {26070, 21075, 15975, 11115, 6860, 3950},
    {28886, 23319, 18300, 13484, 8642, 5057}};

  function thrust "Thrust as a function of power, altitude and Mach number"
    input Real power(unit = "1") "Engine power in percent";
    input Real altitude(unit = "ft");
    input Real mach "Mach number";
    output Real y(unit = "lbf");
  protected
    Real above(unit = "ft") "Altitude, at least 0.01 ft";
    Real mil(unit = "lbf") "Thrust at military power";
  algorithm
    above := max(altitude, 0.01);
    mil := Tables.bilinear(mach, above, machs, altitudes, military);
    if power < 50 then
      y := mil + (Tables.bilinear(mach, above, machs, altitudes, idle) - mil) * (1 - power / 50);
    else
      y := mil + (Tables.bilinear(mach, above, machs, altitudes, maximum) - mil) * (power / 50 - 1);
    end if;
  end thrust;

  function commandedPower "Power commanded by a throttle position"
    input Real throttle "Throttle position, 0 to 1";
    output Real y "Power in percent";
  algorithm
    y := if throttle <= 0.77 then 64.94 * throttle else 217.38 * throttle - 117.38;
  end commandedPower;

  function powerRate "Rate at which power follows the commanded power, with special targets for crossing 50 percent"
    input Real power "Power in percent";
    input Real commanded "Commanded power in percent";
    output Real y "Percent per second";
  protected
    Real target;
  algorithm
    target := if commanded >= 50 and power < 50 then 60 elseif commanded < 50 and power >= 50 then 40 else commanded;
    y := (if power >= 50 then 5 else inverseLag(target - power)) * (target - power);
  end powerRate;

  function inverseLag "Inverse time constant as a function of the distance from the target"
    input Real distance "Difference between target and power in percent";
    output Real y(unit = "1/s");
  algorithm
    y := if distance <= 25 then 1 elseif distance >= 50 then 0.1 else 1.9 - 0.036 * distance;
  end inverseLag;
end F16Engine;
