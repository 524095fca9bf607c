within ArchComp;
model NN "Magnetic levitation: a ball at position Pos floats above an electromagnet. A sampled
neural controller (NARMA-L2) sets the current every 10 ms so that Pos follows the reference
Ref; the current switches between its limits, so Pos ripples around Ref"
  input Real Ref(start = 2, min = 0.5, max = 4, unit = "1") "Reference: desired position of the ball";
  output Real Pos(unit = "1", start = 0.5, fixed = true) "Position of the ball above the magnet";
  discrete output Real NNPos(unit = "1", start = 0, fixed = true)
    "Position predicted by the controller's network, in the network's units";
  parameter Real Ts(unit = "s") = 0.01 "Sample time of the controller";
  parameter Real currentMin(unit = "A") = -1 "Minimum coil current";
  parameter Real currentMax(unit = "A") = 4 "Maximum coil current";
  parameter Real magnet = 5 "Magnet strength per mass";
  parameter Real gravity(unit = "m/s2") = 9.8 "Acceleration of gravity";
  parameter Real friction(unit = "1/s") = 4 "Viscous friction per mass";
  Real velocity(unit = "1/s", start = 0, fixed = true) "Velocity of the ball";
  discrete Real current(unit = "A", start = 0, fixed = true) "Coil current, held between samples";
protected
  constant Real minPosition = 0.0012713472471279201 "Position normalised to -1 for the network";
  constant Real maxPosition = 3.9954019738068034 "Position normalised to +1 for the network";
  constant Real minCurrent = -0.97682887932966278 "Current normalised to -1 for the network";
  constant Real maxCurrent = 3.9954019738068034 "Current normalised to +1 for the network";
  constant Real fGain = 0.9921675075327889 "Gain of the layer after f";
  constant Real gGain = 0.0004116938262844689 * 0.5996797859290577 * (-0.8613021600806045)
    "Product of the gains of the three layers after g";
  constant Real fBias = 0.9079050764793414;
  constant Real gBias = 0.8636776698074995;
  constant Real fIn[9, 4] = {
    {2.856916053916624, 3.8551379736179316, 2.4478436741338867, 0.8688998671315019},
    {0.8601974862411855, -0.7609974876165386, 0.1297838328359965, -0.03268194968370265},
    {-0.6126895156745158, -1.354653876780509, -1.0357145918607806, -2.245021356521297},
    {-0.613636393905946, 3.630279791812776, -2.9742392265006137, 3.7505205510025696},
    {8.215942541955298, -0.34781842703357196, -0.6399097822234708, 3.2203753164455033},
    {-0.5558555855523505, 1.7347260034225613, -0.4878206739919111, 0.1551929255086199},
    {0.14490936608588076, 0.09134499688722511, -1.999917792190961, -1.7398058021589538},
    {-0.011364174849476511, 0.17210174153872684, -0.06300334133173585, 0.0163566809393993},
    {1.9115353490253353, -1.69282907428, 0.2613911596451783, -0.0835215908808596}}
    "Input weights of the nine hidden units of f";
  constant Real fOffset[9] = {
    -2.0540485030510767, -0.28204565482768396, -1.4224984046874725, 0.011980000365264734, -3.283305517615781,
    1.1020848049883287, 2.2616940700361274, -0.14165422591960777, 1.088976924112505};
  constant Real fOut[9] = {
    5.755548244449744e-05, 2.194101728771453, -0.00044492281828180147, -0.0003923797112020545,
    1.8234323877817899e-06, 0.042708432151687514, 0.0002533004910055188, 4.7927194580095165, 0.41991364122019326};
  constant Real gIn[9, 4] = {
    {2.094012153469472, 4.139161749460294, 0.46017743638858905, 1.4212453617040688},
    {-0.8698291152927357, -0.9121639326327016, -1.7725276755524564, -1.8256681774546808},
    {-1.5212626080129232, -1.963839346858477, -0.1308320616684438, 0.6951444310146138},
    {1.106710074706867, 1.10772222997122, -1.6499992245985942, -0.10283142888325142},
    {1.7627456897433946, 0.12387727106338466, -0.7434587257456073, 1.3295242695796243},
    {1.3902623706994512, 1.2486843128494045, 0.6010035722034883, 1.8703374952532537},
    {-1.265262029400432, -0.8100397151897083, 0.35904126229892613, -2.3590512744589045},
    {-1.7962091138833456, 0.3300424895644986, 1.1996735804361836, -0.7584644175666946},
    {1.6085665816521635, -0.6596001199307706, 2.0409314507416925, 1.3008341987199021}}
    "Input weights of the nine hidden units of g";
  constant Real gOffset[9] = {
    -0.9982247397611276, -1.125845792332043, 1.0030562696131118, 3.602065551304344, -0.02518596436748236,
    1.276393628529973, -2.274010065287341, -3.0720977283302817, 1.7835104510380932};
  constant Real gOut[9] = {
    1.179622915707438, 1.4349048600431937, -0.8972572979998953, -2.338627041684287, -0.09669294243932744,
    -0.6343859921507877, -2.737919464469502, 3.0145214892072625, 2.1741978843496215};

  function hiddenLayer "Weighted sum of nine tanh units whose input is the regressor"
    input Real x[4] "Regressor";
    input Real weights[9, 4] "Input weights, one row per unit";
    input Real offset[9] "Offset of each unit";
    input Real out[9] "Output weights";
    output Real y;
  protected
    Real z;
  algorithm
    y := 0;
    for i in 1:9 loop
      z := offset[i];
      for j in 1:4 loop
        z := z + weights[i, j] * x[j];
      end for;
      y := y + out[i] * tanh(z);
    end for;
  end hiddenLayer;

  function normalise "Maps [low, high] to [-1, 1]"
    input Real x;
    input Real low;
    input Real high;
    output Real y;
  algorithm
    y := 2 * (x - low) / (high - low) - 1;
  end normalise;

  discrete Real y(start = 0, fixed = true) "Normalised position at this sample";
  discrete Real u(start = 0, fixed = true) "Normalised current of this sample";
  discrete Real uBefore(start = 0, fixed = true) "Normalised current of the previous sample";
  discrete Real f(start = 0, fixed = true) "Predicted position without the new current";
  discrete Real g(start = 1, fixed = true) "Effect of the new current on the prediction";
equation
  der(Pos) = velocity;
  der(velocity) = magnet * current * abs(current) / Pos - gravity - friction * velocity;
  // At each sample the controller uses the position at that instant, without a delay between Pos and current.
  // The delay lines start at 0 in normalised units, which is not the physical zero.
  when sample(0, Ts) then
    y = normalise(Pos, minPosition, maxPosition);
    f = fGain * (hiddenLayer({y, pre(y), pre(u), pre(uBefore)}, fIn, fOffset, fOut) + fBias);
    g = gGain * (hiddenLayer({y, pre(y), pre(u), pre(uBefore)}, gIn, gOffset, gOut) + gBias);
    current = min(currentMax, max(currentMin,
      ((normalise(Ref, minPosition, maxPosition) - f) / g + 1) * (maxCurrent - minCurrent) / 2 + minCurrent));
    NNPos = f + g * current;
    u = normalise(current, minCurrent, maxCurrent);
    uBefore = pre(u);
  end when;
  // A sample at the end of a communication step is repeated with the next step's inputs, so it uses Ref without delay.
  annotation(
    experiment(StopTime = 40, Interval = 0.01, Tolerance = 1e-6),
    __falsifier_solver(method = "fixed", step = 0.005, repeatTicks = "always"));
end NN;
