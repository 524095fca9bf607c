"""Problems: what is simulated, required and varied, from a spec file or from an FMU and a formula."""
