"""What holds when nobody says otherwise."""

from falsifier.core.model import Interface, ModelInfo

# Control points of an input when nobody says how many: both ends, the middle and two between.
DEFAULT_POINTS = 5
# Samples of the output grid when neither the user nor the FMU gives a step.
_DEFAULT_INTERVALS = 1000


def default_interface(info: ModelInfo) -> Interface | None:
    """Interface to use when nobody says which: co-simulation where the FMU offers it."""
    if "co-simulation" in info.interfaces:
        return "co-simulation"
    return info.interfaces[0] if info.interfaces else None


def default_interval(info: ModelInfo, stop_time: float) -> float:
    """Output interval in s: the FMU's step where it divides the stop time, else a thousandth of it."""
    step = info.step_size
    if step and stop_time / step >= 1 and abs(stop_time / step - round(stop_time / step)) < 1e-6:
        return step
    return stop_time / _DEFAULT_INTERVALS
