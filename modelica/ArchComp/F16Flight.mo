within ArchComp;
partial model F16Flight "Motion of an F-16 with its inner control loop, which follows the load factor and the roll rate
that an autopilot requests"
  import ArchComp.F16Aerodynamics;
  import ArchComp.F16Engine;
  parameter Real roll(min = -3.15, max = 3.15, unit = "rad") = 0.75
    "Roll angle at the start, positive is right wing down";
  parameter Real pitch(min = -1.57, max = 1.57, unit = "rad") = -1.2 "Pitch angle at the start, negative is nose down";
  parameter Real yaw(min = -3.15, max = 3.15, unit = "rad") = -0.8 "Heading at the start, 0 is north";
  parameter Real altitudeStart(min = 0, max = 35000, unit = "ft") = 2338 "Altitude at the start";
  parameter Real speedStart(min = 300, max = 900, unit = "ft/s") = 540 "Airspeed at the start";
  output Real altitude(unit = "ft", start = altitudeStart, fixed = true) "Altitude above the ground";
  output Real vt(unit = "ft/s", start = speedStart, fixed = true) "Airspeed";
  output Real alpha(unit = "rad", start = 2.1215 * rad, fixed = true) "Angle of attack";
  output Real beta(unit = "rad", start = 0, fixed = true) "Sideslip angle";
  output Real phi(unit = "rad", start = roll, fixed = true) "Roll angle";
  output Real theta(unit = "rad", start = pitch, fixed = true) "Pitch angle";
  output Real psi(unit = "rad", start = yaw, fixed = true) "Yaw angle (heading)";
  output Real p(unit = "rad/s", start = 0, fixed = true) "Roll rate";
  output Real q(unit = "rad/s", start = 0, fixed = true) "Pitch rate";
  output Real r(unit = "rad/s", start = 0, fixed = true) "Yaw rate";
  output Real Nz(unit = "1") "Load factor felt by the pilot above the 1 g of level flight";
protected
  constant Real pi = 3.141592653589793;
  constant Real rad(unit = "rad/deg") = pi / 180;
  // Aircraft
  constant Real S(unit = "ft2") = 300 "Wing area";
  constant Real b(unit = "ft") = 30 "Wing span";
  constant Real cbar(unit = "ft") = 11.32 "Mean chord";
  constant Real im(unit = "1/slug") = 1.57e-3 "Inverse mass";
  constant Real heng(unit = "slug.ft2/s") = 160 "Angular momentum of the engine";
  constant Real g(unit = "ft/s2") = 32.17 "Acceleration of gravity";
  constant Real xa(unit = "ft") = 15 "Distance of the pilot in front of the centre of gravity";
  constant Real c1 = -0.770 "c1 to c9: combinations of moments of inertia, as in Stevens and Lewis";
  constant Real c2 = 0.02755;
  constant Real c3 = 1.055e-4;
  constant Real c4 = 1.642e-6;
  constant Real c5 = 0.9604;
  constant Real c6 = 1.759e-2;
  constant Real c7 = 1.792e-5;
  constant Real c8 = -0.7336;
  constant Real c9 = 1.587e-5;
  // Trim of the inner loop
  constant Real alphaTrim(unit = "rad") = 0.0389;
  constant Real elevatorTrim(unit = "deg") = -0.7496;
  constant Real throttle = 0.1395;
  function clip "Limits x to [-limit, limit]"
    input Real x;
    input Real limit;
    output Real y;
  algorithm
    y := min(limit, max(-limit, x));
  end clip;

  Real pn(unit = "ft", start = 0, fixed = true) "Position north";
  Real pe(unit = "ft", start = 0, fixed = true) "Position east";
  Real power(unit = "1", start = 9, fixed = true) "Engine power in percent";
  Real intNz(start = 0, fixed = true) "Integral of the load factor's error";
  Real intPs(start = 0, fixed = true) "Integral of the stability roll rate's error";
  Real intNyr(start = 0, fixed = true) "Integral of the error of side force and yaw rate";
  Real NzRef "Load factor requested by the autopilot";
  Real psRef(unit = "rad/s") "Stability roll rate requested by the autopilot";
  Real elevator(unit = "rad");
  Real aileron(unit = "rad");
  Real rudder(unit = "rad");
  Real tf "Temperature relative to sea level";
  Real qS(unit = "lbf") "Dynamic pressure times wing area";
  Real mach "Mach number";
  Real pHat "Normalised roll rate";
  Real qHat "Normalised pitch rate";
  Real rHat "Normalised yaw rate";
  Real ax(unit = "ft/s2") "Acceleration due to aerodynamics and thrust along the body's x axis";
  Real ay(unit = "ft/s2");
  Real az(unit = "ft/s2");
  Real Cl "Coefficient of the rolling moment";
  Real Cn "Coefficient of the yawing moment";
  Real u(unit = "ft/s") "Velocity along the body's x axis";
  Real v(unit = "ft/s");
  Real w(unit = "ft/s");
  Real du(unit = "ft/s2") "Rate of change of u, from the equations of motion";
  Real dv(unit = "ft/s2");
  Real dw(unit = "ft/s2");
  Real ps(unit = "rad/s") "Stability roll rate";
  Real Ny(unit = "1") "Side force felt by the pilot";
equation
  // Inner loop: linear-quadratic regulator, surfaces limited, integrators not
  elevator = rad * clip(elevatorTrim + 156.8801506723475 * (alpha - alphaTrim) + 31.037008068526642 * q
    + 38.72983346216317 * intNz, 25);
  aileron = rad * clip(-37.84483 * beta + 25.40956 * p + 6.82876 * r + 332.88343 * intPs + 17.15997 * intNyr, 21.5);
  rudder = rad * clip(23.91233 * beta - 5.69968 * p + 21.63431 * r - 64.49490 * intPs + 88.36203 * intNyr, 30);
  der(intNz) = Nz - NzRef;
  der(intPs) = ps - psRef;
  der(intNyr) = Ny + r;
  // The trim angle should not be subtracted here, but the original does so and its results depend on it.
  ps = p * cos(alpha - alphaTrim) + r * sin(alpha - alphaTrim);
  Nz = (xa * der(q) - az) / g - 1;
  Ny = (ay + xa * der(r)) / g;

  // Atmosphere and engine
  tf = 1 - 0.703e-5 * altitude;
  mach = vt / sqrt(1.4 * 1716.3 * (if noEvent(altitude >= 35000) then 390 else 519 * tf));
  qS = 0.5 * 2.377e-3 * tf ^ 4.14 * vt ^ 2 * S;
  der(power) = F16Engine.powerRate(power, F16Engine.commandedPower(throttle));

  // Forces and moments
  pHat = p * b / (2 * vt);
  qHat = q * cbar / (2 * vt);
  rHat = r * b / (2 * vt);
  ax = im * (qS * F16Aerodynamics.CX(alpha, elevator, qHat) + F16Engine.thrust(power, altitude, mach));
  ay = im * qS * F16Aerodynamics.CY(alpha, beta, aileron, rudder, pHat, rHat);
  az = im * qS * F16Aerodynamics.CZ(alpha, beta, elevator, qHat);
  Cl = F16Aerodynamics.Cl(alpha, beta, aileron, rudder, pHat, rHat);
  Cn = F16Aerodynamics.Cn(alpha, beta, aileron, rudder, pHat, rHat);
  der(p) = (c2 * p + c1 * r + c4 * heng) * q + qS * b * (c3 * Cl + c4 * Cn);
  der(q) = (c5 * p - c7 * heng) * r + c6 * (r ^ 2 - p ^ 2) + qS * cbar * c7 * F16Aerodynamics.Cm(alpha, elevator, qHat);
  der(r) = (c8 * p - c2 * r + c9 * heng) * q + qS * b * (c4 * Cl + c9 * Cn);

  // Motion of a rigid body
  u = vt * cos(alpha) * cos(beta);
  v = vt * sin(beta);
  w = vt * sin(alpha) * cos(beta);
  du = r * v - q * w - g * sin(theta) + ax;
  dv = p * w - r * u + g * cos(theta) * sin(phi) + ay;
  dw = q * u - p * v + g * cos(theta) * cos(phi) + az;
  der(vt) = (u * du + v * dv + w * dw) / vt;
  der(alpha) = (u * dw - w * du) / (u ^ 2 + w ^ 2);
  der(beta) = (vt * dv - v * der(vt)) * cos(beta) / (u ^ 2 + w ^ 2);
  der(phi) = p + tan(theta) * (q * sin(phi) + r * cos(phi));
  der(theta) = q * cos(phi) - r * sin(phi);
  der(psi) = (q * sin(phi) + r * cos(phi)) / cos(theta);
  der(pn) = u * cos(theta) * cos(psi) + v * (sin(phi) * sin(theta) * cos(psi) - cos(phi) * sin(psi))
    + w * (cos(phi) * sin(theta) * cos(psi) + sin(phi) * sin(psi));
  der(pe) = u * cos(theta) * sin(psi) + v * (sin(phi) * sin(theta) * sin(psi) + cos(phi) * cos(psi))
    + w * (cos(phi) * sin(theta) * sin(psi) - sin(phi) * cos(psi));
  der(altitude) = u * sin(theta) - v * sin(phi) * cos(theta) - w * cos(phi) * cos(theta);
end F16Flight;
