within Features;
model Inherited "extends with a modifier, import, qualified names"
  extends Base(final gain = 3, x(start = 2));
  import Features.Functions.polynomial;
  import F = Features.Functions;
  output Real z;
  output Real w;
equation
  z = polynomial(x, {0, gain});
  w = F.early(1.0) + Features.squares[2];
  annotation(experiment(StopTime = 1, Tolerance = 1e-9));
end Inherited;
