within ArchComp;
model SC "Steam condenser: cooling water condenses the incoming steam Fs; a
recurrent neural controller sets the cooling flow Fcw so that the measured
pressure follows its set point, which drops from 90 to 87 kPa at 2 s"
  import ArchComp.Tables.linear;
  input Real Fs(start = 4, min = 3.5, max = 4.5, unit = "kg/s") "Steam flow into the condenser";
  output Real T(unit = "degC", start = 80, fixed = true) "Temperature of the cooling water at the outlet";
  output Real Fcw(unit = "kg/s", start = Fcw0, fixed = true) "Flow of cooling water";
  output Real Q(unit = "kW") "Heat flow from the steam to the cooling water";
  output Real pressure(unit = "kPa", start = 90, fixed = true) "Condenser pressure as measured by the sensor";
  parameter Real Tcw(unit = "degC") = 60 "Temperature of the cooling water at the inlet";
  parameter Real Mcw(unit = "kg") = 500 "Mass of cooling water in the condenser";
  parameter Real Cp(unit = "kJ/(kg.K)") = 4.2 "Specific heat of water";
  parameter Real V(unit = "m3") = 3 "Steam volume";
  parameter Real R(unit = "kJ/(kg.K)") = 0.461526 "Gas constant of steam";
  parameter Real tau(unit = "s") = 1 "Time constant of the cooling flow; that of the sensor is half of it";
  parameter Real Fcw0(unit = "kg/s") = 107.8880952381 "Nominal cooling flow, to which the controller adds its correction";
  parameter Real FcwMax(unit = "kg/s") = 200 "Maximum cooling flow";
  parameter Real tSet(unit = "s") = 2 "Time at which the set point changes";
  parameter Real setBefore(unit = "kPa") = 90 "Set point before that time";
  parameter Real setAfter(unit = "kPa") = 87 "Set point from that time on";
protected
  constant Real resistance = 0.0872924756541668 "Thermal resistance on the water side at a flow of 1 kg/s";
  constant Real wall(unit = "K/kW") = 0.00073786772008033 "Thermal resistance of the wall";
  constant Real steamPressure[7](each unit = "kPa") = {50, 60, 70, 80, 90, 100, 110};
  constant Real condensingTemperature[7](each unit = "degC") = {
    81.3167, 85.9258, 89.9315, 93.4854, 96.6870, 99.6059, 102.2923} "At these pressures";
  constant Real condensationHeat[7](each unit = "kJ/kg") = {
    2305.42, 2293.64, 2283.30, 2274.05, 2265.65, 2257.92, 2250.76} "At these pressures";
  // Network: three tanh units; their inputs are the error and two filtered copies of their own outputs
  constant Real errorMin(unit = "kPa") = -3.7742393716738434 "Error normalised to -1 for the network";
  constant Real errorMax(unit = "kPa") = 5.7997431225043385 "Error normalised to +1 for the network";
  constant Real flowMin(unit = "kg/s") = -30.855068745036114 "Flow normalised to -1 for the network";
  constant Real flowMax(unit = "kg/s") = 66.879264965962932 "Flow normalised to +1 for the network";
  constant Real pole(unit = "1/s") = 10 "Pole of the filters in the feedback of the network";
  constant Real inputWeight[3] = {-0.36932254958803395, 0.37111199431650393, -0.52736280584118833};
  constant Real offset[3] = {0.40129050296348601, -0.12475735064274925, -1.3584541012442735};
  constant Real weight1[3, 3] = {
    {0.44769854454577174, 1.1961840315574388, 1.1412233787458486},
    {-0.16668730359454359, -0.016432941671533533, -0.22132796342367161},
    {0.24187644262601646, -0.66963285238228187, -1.0984401489322673}} "Weights of the first filter";
  constant Real weight2[3, 3] = {
    {0.72001623019786209, -0.37547125154051064, -0.61546760904874331},
    {-0.037206224095552992, 0.059874671921603305, 0.080202592729115826},
    {0.029109804692608397, 1.3722216833345802, 0.66166906669524039}} "Weights of the second filter";
  constant Real outputWeight[3] = {-0.22749313555095124, 2.0804967759906643, -0.56644809886208158};
  constant Real outputOffset = -0.33227866684137108;

  Real P(unit = "kPa", start = 90, fixed = true) "Pressure in the condenser";
  Real Tc(unit = "degC") "Condensing temperature";
  Real lambda(unit = "kJ/kg") "Heat of condensation";
  Real dT(unit = "K") "Logarithmic mean temperature difference between steam and water";
  Real setPoint(unit = "kPa") "Set point of the pressure";
  Real error "Measured pressure minus set point, normalised for the network";
  Real correction(unit = "kg/s") "Cooling flow that the network adds";
  Real hidden[3] "Outputs of the tanh units";
  Real first[3](each start = 0, each fixed = true) "First filters of the units' outputs";
  Real second[3](each start = 0, each fixed = true) "Second filters, in series with the first";
equation
  // Condenser
  Tc = linear(P, steamPressure, condensingTemperature);
  lambda = linear(P, steamPressure, condensationHeat);
  dT = (T - Tcw) / log((Tc - Tcw) / (Tc - T));
  Q = dT / (resistance / Fcw ^ 0.8 + wall);
  der(T) = (Q / Cp + Fcw * (Tcw - T)) / Mcw;
  der(P) = R / V * Tc * (Fs - Q / lambda);
  // Actuator and sensor
  der(Fcw) = (min(FcwMax, max(0, Fcw0 + correction)) - Fcw) / tau;
  der(pressure) = (P - pressure) / (tau / 2);
  // Controller; the original's disturbance of the flow, a step of height zero at 10 s, is omitted
  setPoint = if time < tSet then setBefore else setAfter;
  error = 2 * (pressure - setPoint - errorMin) / (errorMax - errorMin) - 1;
  for i in 1:3 loop
    hidden[i] = tanh(offset[i] + inputWeight[i] * error
      + weight1[i, 1] * first[1] + weight1[i, 2] * first[2] + weight1[i, 3] * first[3]
      + weight2[i, 1] * second[1] + weight2[i, 2] * second[2] + weight2[i, 3] * second[3]);
    der(first[i]) = hidden[i] - pole * first[i];
    der(second[i]) = first[i] - pole * second[i];
  end for;
  correction = flowMin + (flowMax - flowMin) / 2 * (1 + outputOffset
    + outputWeight[1] * hidden[1] + outputWeight[2] * hidden[2] + outputWeight[3] * hidden[3]);
  annotation(
    experiment(StopTime = 35, Interval = 0.01, Tolerance = 1e-8),
    __falsifier_solver(method = "fixed", step = 0.01));
end SC;
