"""What is simulated, what must hold and what may be varied: from spec files, or an FMU and a formula."""
