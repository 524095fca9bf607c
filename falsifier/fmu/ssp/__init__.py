"""SSP packages as systems of FMUs."""
