"""FMUs: what they say of themselves, how they are stepped, and the process they run in."""

from falsifier.fmu.description import read_info
from falsifier.fmu.simulator import FmuModel

__all__ = ["FmuModel", "read_info"]
