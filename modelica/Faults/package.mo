package Faults "Small controllers, each with a fault that shows only after a sequence of events"
  annotation(version = "1.0.0", Documentation(info = "<html><p>Requirements on these systems speak of counters and
switches: how far an input is from showing the fault cannot be read from them until it is there.</p></html>"));
end Faults;
