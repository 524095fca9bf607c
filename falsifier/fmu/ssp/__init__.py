"""SSP packages as systems of FMUs."""

from falsifier.fmu.ssp.package import SUFFIXES
from falsifier.fmu.ssp.reader import is_package, read_package

__all__ = ["SUFFIXES", "is_package", "read_package"]
