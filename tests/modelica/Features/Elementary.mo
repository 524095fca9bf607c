within Features;
model Elementary "Elementary functions"
  input Real u(start = 0.5);
  output Real y[19];
equation
  y = {sqrt(u), exp(u), log(u), log10(u), sin(u), cos(u), tan(u), asin(u), acos(u), atan(u), atan2(u, -1), sinh(u),
    cosh(u), tanh(u), abs(-u), min(u, 0.25), max(u, 0.25), u ^ 3, u ^ 2};
end Elementary;
