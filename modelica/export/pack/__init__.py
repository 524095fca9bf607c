"""Description and C sources -> FMU."""
