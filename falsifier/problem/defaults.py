"""Defaults for what neither the user nor the FMU specifies."""

from falsifier.core.model import Interface, ModelInfo

# Number of control points of an input: both ends, the middle and two in between.
DEFAULT_POINTS = 5
# Name of the requirement that a formula makes if it is given without a name.
STL_NAME = "stl"
# Number of output intervals if neither the user nor the FMU specifies a step.
_DEFAULT_INTERVALS = 1000


def default_interface(info: ModelInfo) -> Interface | None:
    """Return the default interface: co-simulation if the FMU offers it, with its exporting tool's solver."""
    if "co-simulation" in info.interfaces:
        return "co-simulation"
    return info.interfaces[0] if info.interfaces else None


def default_interval(info: ModelInfo, stop_time: float) -> float:
    """Return the output interval in s: the FMU's step if it divides the stop time, else 1/1000 of that."""
    step = info.step_size
    if step and stop_time / step >= 1 and abs(stop_time / step - round(stop_time / step)) < 1e-6:
        return step
    return stop_time / _DEFAULT_INTERVALS
