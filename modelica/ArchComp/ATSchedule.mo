within ArchComp;
partial model ATSchedule "Shift logic of a four-speed automatic transmission; how it sees the car is left open"
  import ArchComp.Tables.bilinear;

  output Integer gear(start = 1, min = 1, max = 4) "Gear of the transmission, 1 is the lowest";
  parameter Integer waitTicks(min = 0) = 2 "Number of 0.04 s ticks for which a threshold must stay crossed before a shift";

protected
  Real seenThrottle(unit = "%") "Throttle opening that the logic sees";
  Real seenSpeed(unit = "mph") "Vehicle speed that the logic sees";
  constant Real gears[4] = {1, 2, 3, 4};
  constant Real upThrottle[6] = {0, 25, 35, 50, 90, 100};
  constant Real upSpeed[6, 4] = [10, 30, 50, 1e6; 10, 30, 50, 1e6; 15, 30, 50, 1e6; 23, 41, 60, 1e6; 40, 70, 100, 1e6;
    40, 70, 100, 1e6];
  constant Real downThrottle[6] = {0, 5, 40, 50, 90, 100};
  constant Real downSpeed[6, 4] = [0, 5, 20, 35; 0, 5, 20, 35; 0, 5, 25, 40; 0, 5, 30, 50; 0, 30, 50, 80; 0, 30, 50, 80];

  Integer region(start = 0) "Shift chart: 0 steady, 1 waiting to shift up, 2 waiting to shift down";
  Integer ticks(start = 0) "Ticks since the last change of region";
  Boolean started(start = false) "The chart is entered at the first tick and active from the second one";
  Real up(unit = "mph", start = 0) "Speed above which a higher gear is selected";
  Real down(unit = "mph", start = 0) "Speed below which a lower gear is selected";
algorithm
  when sample(0, 0.04) then
    if pre(started) then
      ticks := pre(ticks) + 1;
      up := bilinear(seenThrottle, pre(gear), upThrottle, gears, upSpeed);
      down := bilinear(seenThrottle, pre(gear), downThrottle, gears, downSpeed);
      if pre(region) == 0 then
        if seenSpeed > up then
          region := 1;
          ticks := 0;
        elseif seenSpeed < down then
          region := 2;
          ticks := 0;
        end if;
      elseif pre(region) == 1 then
        if ticks >= waitTicks and seenSpeed >= up then
          gear := min(4, pre(gear) + 1);
          region := 0;
        elseif seenSpeed < up then
          region := 0;
        end if;
      else
        if ticks >= waitTicks and seenSpeed <= down then
          gear := max(1, pre(gear) - 1);
          region := 0;
        elseif seenSpeed > down then
          region := 0;
        end if;
      end if;
    end if;
    started := true;
  end when;
end ATSchedule;
