model Suspension "Front and rear suspension of a van that crosses a speed bump and then a washboard. The body moves up and
down and pitches; a bump stop hardens each spring near the end of its travel, and dampers differ between compression and
rebound"
  parameter Real mass(unit = "kg", min = 500, max = 900) = 700 "Half of the body, with load";
  parameter Real inertia(unit = "kg.m2", min = 700, max = 1600) = 1100 "Half of the body's inertia in pitch";
  parameter Real front(unit = "m", min = 1, max = 1.6) = 1.3 "From the centre of mass to the front axle";
  parameter Real rear(unit = "m", min = 1.1, max = 1.8) = 1.5 "From the centre of mass to the rear axle";
  parameter Real springFront(unit = "N/m", min = 14000, max = 34000) = 22000 "Stiffness of the front spring";
  parameter Real springRear(unit = "N/m", min = 14000, max = 34000) = 24000 "Stiffness of the rear spring";
  parameter Real compressFront(unit = "N.s/m", min = 500, max = 3000) = 1100 "Front damper in compression";
  parameter Real reboundFront(unit = "N.s/m", min = 800, max = 4500) = 2200 "Front damper in rebound";
  parameter Real compressRear(unit = "N.s/m", min = 500, max = 3000) = 1100 "Rear damper in compression";
  parameter Real reboundRear(unit = "N.s/m", min = 800, max = 4500) = 2200 "Rear damper in rebound";
  parameter Real tyre(unit = "N/m", min = 140000, max = 260000) = 200000 "Stiffness of a tyre";
  parameter Real wheel(unit = "kg", min = 25, max = 60) = 40 "Mass of a wheel";
  parameter Real clearance(unit = "m", min = 0.05, max = 0.1) = 0.08 "Travel before a bump stop is reached";
  parameter Real speed(unit = "m/s", min = 4, max = 12) = 8 "Speed of the van";
  parameter Real spacing(unit = "m", min = 0.6, max = 5) = 2 "Length of a wave of the washboard";
  output Real heave(unit = "m", start = 0, fixed = true) "Height of the body above its rest";
  output Real pitch(unit = "rad", start = 0, fixed = true) "Angle of the body, nose up";
  output Real comfort(unit = "m/s2", start = 0, fixed = true, min = 0) "Vertical acceleration at the seat, mean over 1 s";
  output Real travelFront(unit = "m") "Compression of the front spring from rest";
  output Real travelRear(unit = "m") "Compression of the rear spring from rest";
  output Real gripFront(unit = "1") "Load of the front tyre, as a share of its load at rest";
  output Real gripRear(unit = "1") "Load of the rear tyre, as a share of its load at rest";
protected
  constant Real gravity = 9.81;
  constant Real stop(unit = "N/m3") = 4e7 "Hardening of a bump stop";
  Real lift(start = 0, fixed = true);
  Real turning(start = 0, fixed = true);
  Real wheelFront(start = 0, fixed = true);
  Real wheelRear(start = 0, fixed = true);
  Real riseFront(start = 0, fixed = true);
  Real riseRear(start = 0, fixed = true);
  Real rateFront;
  Real rateRear;
  Real forceFront "Of spring, damper and bump stop on the body, beyond its weight";
  Real forceRear;
  Real loadFront "Of the tyre, beyond its load at rest";
  Real loadRear;
  Real restFront;
  Real restRear;

  function road "Height of the road: a bump of 1.5 m after 5 m, a washboard from 20 m on"
    input Real place;
    input Real spacing;
    output Real height;
  algorithm
    height := if place > 5 and place < 6.5 then 0.05 * (1 - cos(2 * 3.141592653589793 * (place - 5) / 1.5)) / 2
      elseif place > 20 then 0.012 * sin(2 * 3.141592653589793 * (place - 20) / spacing) else 0;
  end road;

  function strut "Force of spring, damper and bump stop on the body, beyond its weight"
    input Real travel;
    input Real rate;
    input Real spring;
    input Real compress;
    input Real rebound;
    input Real clearance;
    output Real force;
  algorithm
    force := spring * travel + (if rate > 0 then compress else rebound) * rate
      + stop * max(0, travel - clearance) ^ 3 - stop * max(0, -travel - clearance) ^ 3;
  end strut;

  function contact "Load of a tyre beyond its load at rest; it does not pull at the road"
    input Real squeeze;
    input Real rest;
    output Real load;
  algorithm
    load := max(-rest, squeeze);
  end contact;
equation
  restFront = (mass * rear / (front + rear) + wheel) * gravity;
  restRear = (mass * front / (front + rear) + wheel) * gravity;
  travelFront = wheelFront - heave - front * pitch;
  travelRear = wheelRear - heave + rear * pitch;
  rateFront = riseFront - lift - front * turning;
  rateRear = riseRear - lift + rear * turning;
  forceFront = strut(travelFront, rateFront, springFront, compressFront, reboundFront, clearance);
  forceRear = strut(travelRear, rateRear, springRear, compressRear, reboundRear, clearance);
  loadFront = contact(tyre * (road(speed * time, spacing) - wheelFront), restFront);
  loadRear = contact(tyre * (road(speed * time - front - rear, spacing) - wheelRear), restRear);
  gripFront = 1 + loadFront / restFront;
  gripRear = 1 + loadRear / restRear;
  der(heave) = lift;
  der(pitch) = turning;
  der(wheelFront) = riseFront;
  der(wheelRear) = riseRear;
  der(lift) = (forceFront + forceRear) / mass;
  der(turning) = (front * forceFront - rear * forceRear) / inertia;
  der(riseFront) = (loadFront - forceFront) / wheel;
  der(riseRear) = (loadRear - forceRear) / wheel;
  der(comfort) = abs((forceFront + forceRear) / mass + 0.4 * (front * forceFront - rear * forceRear) / inertia) - comfort;
  annotation(
    experiment(StopTime = 8, Interval = 0.01, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.002));
end Suspension;
