package ArchComp "Systems of the ARCH-COMP falsification category"
  annotation(version = "1.0.0", Documentation(info = "<html><p>Each model states in its description what the system
is and what its signals mean. Inputs, outputs and parameters carry units, ranges and descriptions; an FMU made from
a model inherits all of them.</p></html>"));
end ArchComp;
