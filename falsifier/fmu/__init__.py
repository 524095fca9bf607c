"""FMUs: reading their description, stepping them, and isolating them in processes of their own."""

from falsifier.fmu.description import read_info
from falsifier.fmu.simulator import FmuModel

__all__ = ["FmuModel", "read_info"]
