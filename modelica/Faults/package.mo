package Faults "Small controllers, each with a fault that shows only after a sequence of events"
  annotation(version = "1.0.0", Documentation(info = "<html><p>The requirements on these systems are about counters and
switches, so their robustness does not show how close an input is to revealing the fault.</p></html>"));
end Faults;
