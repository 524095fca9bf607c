package ArchComp "Models of the ARCH-COMP falsification category"
  annotation(version = "1.0.0", Documentation(info = "<html><p>The description of each model explains the system and
its signals. Inputs, outputs and parameters have units, ranges and descriptions, which an FMU exported from a model
inherits.</p></html>"));
end ArchComp;
