within ArchComp;
package F16Aerodynamics "Force and moment coefficients of the F-16: Morelli's
polynomials (1998), with the damping table of Stevens and Lewis added on top"
  // The polynomials already contain the damping; adding the table counts it twice. The benchmark does so, and its
  // results depend on it. Angles and surface deflections are in rad; pHat, qHat, rHat are body rates normalised by
  // span or chord over twice the speed.
  // Each letter is the coefficient vector with the same letter in Morelli's paper.
  constant Real a[7] = {-0.01943367, 0.2136104, -0.2903457, -0.003348641, -0.2060504, 0.6988016, -0.9035381} "CX";
  constant Real b[5] = {0.4833383, 8.644627, 11.31098, -74.22961, 60.75776} "CX of the pitch rate";
  constant Real c[3] = {-1.145916, 0.06016057, 0.1642479} "CY";
  constant Real d[4] = {-0.1006733, 0.8679799, 4.260586, -6.923267} "CY of the roll rate";
  constant Real e[4] = {0.8071648, 0.1189633, 4.177702, -9.162236} "CY of the yaw rate";
  constant Real f[6] = {-0.1378278, -4.211369, 4.775187, -10.26225, 8.399763, -0.4354} "CZ";
  constant Real g[5] = {-30.54956, -41.32305, 329.2788, -684.8038, 408.0244} "CZ of the pitch rate";
  constant Real h[8] = {
    -0.105853, -0.5776677, -0.01672435, 0.1357256, 0.2172952, 3.464156, -2.835451, -1.098104} "Cl";
  constant Real i[4] = {-0.4126806, -0.1189974, 1.247721, -0.7391132} "Cl of the roll rate";
  constant Real j[5] = {0.06250437, 0.6067723, -1.101964, 9.100087, -11.92672} "Cl of the yaw rate";
  constant Real k[7] = {
    -0.1463144, -0.0407391, 0.03253159, 0.4851209, 0.297885, -0.3746393, -0.3213068} "Cl of the ailerons";
  constant Real l[7] = {
    0.02635729, -0.0219291, -0.003152901, -0.05817803, 0.4516159, -0.4928702, -0.01579864} "Cl of the rudder";
  constant Real m[8] = {
    -0.0202937, 0.04660702, -0.6012308, -0.08062977, 0.08320429, 0.5018538, 0.6378864, 0.4226356} "Cm";
  constant Real n[6] = {-5.19153, -3.554716, -35.98636, 224.7355, -412.0991, 241.175} "Cm of the pitch rate";
  constant Real o[7] = {0.2993363, 0.06594004, -0.2003125, -0.06233977, -2.107885, 2.14142, 0.8476901} "Cn";
  constant Real p[5] = {0.02677652, -0.3298246, 0.1926178, 4.013325, -4.404302} "Cn of the roll rate";
  constant Real q[3] = {-0.3698756, -0.1167551, -0.7641297} "Cn of the yaw rate";
  constant Real r[10] = {
    -0.03348717, 0.04276655, 0.006573646, 0.3535831, -1.373308, 1.237582, 0.2302543, -0.2512876, 0.1588105,
    -0.5199526} "Cn of the ailerons";
  constant Real s[6] = {-0.08115894, -0.0115658, 0.02514167, 0.2038748, -0.3337476, 0.1004297} "Cn of the rudder";
  constant Real degPerRad = 180 / 3.141592653589793;
  // Damping derivatives as functions of the angle of attack in deg
  constant Real attack[12] = {-10, -5, 0, 5, 10, 15, 20, 25, 30, 35, 40, 45};
  constant Real CXq[12] = {-0.267, -0.11, 0.308, 1.34, 2.08, 2.91, 2.76, 2.05, 1.5, 1.49, 1.83, 1.21};
  constant Real CYr[12] = {0.882, 0.852, 0.876, 0.958, 0.962, 0.974, 0.819, 0.483, 0.59, 1.21, -0.493, -1.04};
  constant Real CYp[12] = {-0.108, -0.108, -0.188, 0.11, 0.258, 0.226, 0.344, 0.362, 0.611, 0.529, 0.298, -2.27};
  constant Real CZq[12] = {-8.8, -25.8, -28.9, -31.4, -31.2, -30.7, -27.7, -28.2, -29.0, -29.8, -38.3, -35.3};
  constant Real Clr[12] = {-0.126, -0.026, 0.063, 0.113, 0.208, 0.23, 0.319, 0.437, 0.68, 0.1, 0.447, -0.33};
  constant Real Clp[12] = {-0.36, -0.359, -0.443, -0.42, -0.383, -0.375, -0.329, -0.294, -0.23, -0.21, -0.12, -0.1};
  constant Real Cmq[12] = {-7.21, -0.54, -5.23, -5.26, -6.11, -6.64, -5.69, -6.0, -6.2, -6.4, -6.6, -6.0};
  constant Real Cnr[12] = {-0.38, -0.363, -0.378, -0.386, -0.37, -0.453, -0.55, -0.582, -0.595, -0.637, -1.02, -0.84};
  constant Real Cnp[12] = {0.061, 0.052, 0.052, -0.012, -0.013, -0.024, 0.05, 0.15, 0.13, 0.158, 0.24, 0.15};

  function polynomial "c[1] + c[2] x + c[3] x^2 + ..."
    input Real c[:] "Coefficients, constant term first";
    input Real x;
    output Real y;
  algorithm
    y := 0;
    for i in size(c, 1):-1:1 loop
      y := y * x + c[i];
    end for;
  end polynomial;

  function damping "A damping derivative at an angle of attack"
    input Real table[12];
    input Real alpha(unit = "rad");
    output Real y;
  algorithm
    y := Tables.linear(alpha * degPerRad, attack, table);
  end damping;

  function CX "Coefficient of the force along the body's x axis"
    input Real alpha(unit = "rad") "Angle of attack";
    input Real elevator(unit = "rad");
    input Real qHat "Normalised pitch rate";
    output Real y;
  algorithm
    y := a[1] + a[2] * alpha + a[3] * elevator ^ 2 + a[4] * elevator + a[5] * alpha * elevator
      + a[6] * alpha ^ 2 + a[7] * alpha ^ 3 + (polynomial(b, alpha) + damping(CXq, alpha)) * qHat;
  end CX;

  function CY "Coefficient of the force along the body's y axis"
    input Real alpha(unit = "rad") "Angle of attack";
    input Real beta(unit = "rad") "Sideslip";
    input Real aileron(unit = "rad");
    input Real rudder(unit = "rad");
    input Real pHat "Normalised roll rate";
    input Real rHat "Normalised yaw rate";
    output Real y;
  algorithm
    y := c[1] * beta + c[2] * aileron + c[3] * rudder
      + (polynomial(d, alpha) + damping(CYp, alpha)) * pHat
      + (polynomial(e, alpha) + damping(CYr, alpha)) * rHat;
  end CY;

  function CZ "Coefficient of the force along the body's z axis"
    input Real alpha(unit = "rad") "Angle of attack";
    input Real beta(unit = "rad") "Sideslip";
    input Real elevator(unit = "rad");
    input Real qHat "Normalised pitch rate";
    output Real y;
  algorithm
    y := (f[1] + f[2] * alpha + f[3] * alpha ^ 2 + f[4] * alpha ^ 3 + f[5] * alpha ^ 4) * (1 - beta ^ 2)
      + f[6] * elevator + (polynomial(g, alpha) + damping(CZq, alpha)) * qHat;
  end CZ;

  function Cl "Coefficient of the rolling moment"
    input Real alpha(unit = "rad") "Angle of attack";
    input Real beta(unit = "rad") "Sideslip";
    input Real aileron(unit = "rad");
    input Real rudder(unit = "rad");
    input Real pHat "Normalised roll rate";
    input Real rHat "Normalised yaw rate";
    output Real y;
  algorithm
    y := beta * (h[1] + h[2] * alpha + h[3] * alpha ^ 2 + h[6] * alpha ^ 3 + h[7] * alpha ^ 4)
      + beta ^ 2 * (h[4] + h[5] * alpha + h[8] * alpha ^ 2)
      + (polynomial(i, alpha) + damping(Clp, alpha)) * pHat
      + (polynomial(j, alpha) + damping(Clr, alpha)) * rHat
      + aileron * (k[1] + k[2] * alpha + k[3] * beta + k[4] * alpha ^ 2 + k[5] * alpha * beta
        + k[6] * alpha ^ 2 * beta + k[7] * alpha ^ 3)
      + rudder * (l[1] + l[2] * alpha + l[3] * beta + l[4] * alpha * beta + l[5] * alpha ^ 2 * beta
        + l[6] * alpha ^ 3 * beta + l[7] * beta ^ 2);
  end Cl;

  function Cm "Coefficient of the pitching moment"
    input Real alpha(unit = "rad") "Angle of attack";
    input Real elevator(unit = "rad");
    input Real qHat "Normalised pitch rate";
    output Real y;
  algorithm
    y := m[1] + m[2] * alpha + m[3] * elevator + m[4] * alpha * elevator + m[5] * elevator ^ 2
      + m[6] * alpha ^ 2 * elevator + m[7] * elevator ^ 3 + m[8] * alpha * elevator ^ 2
      + (polynomial(n, alpha) + damping(Cmq, alpha)) * qHat;
  end Cm;

  function Cn "Coefficient of the yawing moment"
    input Real alpha(unit = "rad") "Angle of attack";
    input Real beta(unit = "rad") "Sideslip";
    input Real aileron(unit = "rad");
    input Real rudder(unit = "rad");
    input Real pHat "Normalised roll rate";
    input Real rHat "Normalised yaw rate";
    output Real y;
  algorithm
    y := beta * (o[1] + o[2] * alpha + o[5] * alpha ^ 2 + o[7] * alpha ^ 3)
      + beta ^ 2 * (o[3] + o[4] * alpha + o[6] * alpha ^ 2)
      + (polynomial(p, alpha) + damping(Cnp, alpha)) * pHat
      + (polynomial(q, alpha) + damping(Cnr, alpha)) * rHat
      + aileron * (r[1] + r[2] * alpha + r[3] * beta + r[4] * alpha * beta + r[5] * alpha ^ 2 * beta
        + r[6] * alpha ^ 3 * beta + r[7] * alpha ^ 2 + r[8] * alpha ^ 3 + r[9] * beta ^ 3
        + r[10] * alpha * beta ^ 3)
      + rudder * (s[1] + s[2] * alpha + s[3] * beta + s[4] * alpha * beta + s[5] * alpha ^ 2 * beta
        + s[6] * alpha ^ 2);
  end Cn;
end F16Aerodynamics;
