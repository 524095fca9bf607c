model M
  Modelica.Blocks.Sources.Sine s;  // error: Standard Library is not available
equation
end M;
