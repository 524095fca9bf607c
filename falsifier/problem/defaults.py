"""Defaults for what neither the user nor the FMU specifies."""

from falsifier.core.model import Interface, ModelInfo

# Number of control points of an input: both ends, the middle and two in between.
DEFAULT_POINTS = 5
# Name of the requirement that a formula makes if it is given without a name.
STL_NAME = "stl"


def default_interface(info: ModelInfo) -> Interface | None:
    """Return the default interface: co-simulation if the FMU offers it, with its exporting tool's solver."""
    if "co-simulation" in info.interfaces:
        return "co-simulation"
    return info.interfaces[0] if info.interfaces else None
