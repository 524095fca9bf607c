package Features "Small models with known solutions, one for each language feature of the exporter"
  constant Real gravity(unit = "m/s2") = 9.81;
  constant Integer steps = 3;
  constant Real squares[steps] = {1, 4, 9};
  type Speed = Real(unit = "m/s", nominal = 10);
end Features;
