"""The monitored time grid, if the user states none, and what else follows from the times in formulas.

All times are compared as fractions: in floating point 3 s is not a multiple of 0.003 s.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from math import ceil

from falsifier.core.experiment import MAX_STEPS, common_part, exact
from falsifier.core.literals import digits
from falsifier.errors import SpecError
from falsifier.problem.sections import FreeSection
from falsifier.stl import Formula

# Number of intervals if the FMU specifies no step.
_DEFAULT_INTERVALS = 1000
# Maximum number of intervals that times such as 3.14159 s may cause; the FMU's own step may cause more.
_MAX_INTERVALS = 100_000
# Intervals with this many digits or more are no rounder than others.
_MANY_DIGITS = 8
# In s: the program that runs FMUs takes times for equal that are a tenth of this apart.
_SHORTEST_STEP = 1e-10
# An input that changes this often within the formula's smallest window can meet each of its conditions.
_PIECES_PER_WINDOW = 10
# Minimum number of pieces if the windows ask for fewer, and their maximum number.
_FEWEST_PIECES = 200
_MOST_PIECES = 1000


@dataclass(frozen=True, slots=True)
class Grid:
    """A time grid: its step in s, and why this one, in words."""

    interval: float
    reason: str


def choose_grid(
    stop_time: float,
    *,
    times: Iterable[float] = (),
    fmu_step: float | None = None,
    internal_step: float | None = None,
    step_size: float | None = None,
) -> Grid:
    """Return the grid with the FMU's step, or the next finer one, that fits the stop time and all times.

    Args:
        stop_time: end of the simulation in s.
        times: times in s that formulas name; those after the stop time are ignored.
        fmu_step: the FMU's default step in s, if it specifies one.
        internal_step: step in s of its own solver, of which the interval is a multiple if those given are.
        step_size: communication step in s, if it is stated; the interval is a multiple of it.

    Raises:
        SpecError: if only a very fine grid fits, or the communication step does not, or a step is far too
            short for the stop time.
    """
    # Otherwise the search below for a round interval would take minutes.
    check_steps(stop_time, fmu_step or None)
    check_steps(stop_time, step_size, key="model.step_size")
    stop = exact(stop_time)
    named = sorted({t for t in map(exact, times) if 0 < t <= stop})
    common = common_part(stop, *named)
    wanted = exact(fmu_step) if fmu_step and fmu_step <= stop_time else stop / _DEFAULT_INTERVALS
    if step_size and common % exact(step_size):
        fits = _fitting(stop, named)
        raise SpecError(f"{step_size:g} s does not divide {fits}; change one of these", key="model.step_size")
    is_too_short = internal_step and stop_time / internal_step > MAX_STEPS
    # A default step that is no multiple of it contradicts it, and was chosen for the whole FMU.
    if step_size or is_too_short or (fmu_step and internal_step and exact(fmu_step) % exact(internal_step)):
        internal_step = None
    base = step_size or internal_step
    is_multiple = base is not None and common % exact(base) == 0
    interval = common / _count(common, wanted, exact(base) if base and is_multiple else None)
    finest = min(wanted, stop / _MAX_INTERVALS)
    if interval < finest:
        rounded = stop / _DEFAULT_INTERVALS
        raise SpecError(
            f"no grid of at most {_MAX_INTERVALS} intervals fits {_fitting(stop, named)}; round these times, "
            f"for example to multiples of {_text(rounded)} s"
        )
    fits = _fitting(stop, named)
    reason = _reason(interval, fits, stop_time, fmu_step or internal_step, step_size)
    if internal_step and not is_multiple:
        reason += f", but the FMU may refuse it: round these times to multiples of {internal_step:g} s"
    elif internal_step and not (fmu_step and interval == wanted):
        reason = f"a multiple of the FMU's internal step {internal_step:g} s; this divides {fits}"
    return Grid(float(interval), reason)


def formula_times(formulas: Iterable[Formula]) -> list[float]:
    """Return the bounds in s of all windows."""
    windows = (window for formula in formulas for window in formula.windows)
    return [bound for window in windows for bound in (window.start, window.end)]


def fitting_interval(formula: Formula, stop_time: float, **steps: float | None) -> float | None:
    """Return the step in s of a grid for the formula and the FMU's ``steps``; None if there is none."""
    if exact(formula.horizon()) > exact(stop_time):
        return None
    try:
        return choose_grid(stop_time, times=formula_times([formula]), **steps).interval
    except SpecError:
        return None


def _count(common: Fraction, wanted: Fraction, step_size: Fraction | None) -> int:
    """Return the number of intervals in the common time: few that are no longer than wanted, and round."""
    count = max(1, ceil(common / wanted))
    if step_size is not None:
        steps = int(common / step_size)
        return next(n for n in range(min(count, steps), steps + 1) if not steps % n)
    if common == count * wanted:
        return count
    # Thirds of a second have no end in decimals, however many digits are looked at.
    candidates = range(count, min(2 * count, count + _MAX_INTERVALS) + 1)
    return min(candidates, key=lambda n: (min(digits(float(common / n)), _MANY_DIGITS), n))


def _reason(interval: Fraction, fits: str, stop: float, fmu_step: float | None, step: float | None) -> str:
    if fmu_step and interval == exact(fmu_step):
        return "the FMU's step"
    if step:
        return f"a multiple of step_size = {step:g} s; this divides {fits}"
    if not fmu_step:
        return f"the FMU specifies no step; this divides {fits}"
    if fmu_step > stop:
        return f"the FMU's step {fmu_step:g} s is longer than the stop time; this divides {fits}"
    return f"the FMU's step {fmu_step:g} s does not divide {fits}; this does"


def _fitting(stop: Fraction, named: list[Fraction]) -> str:
    return f"the stop time {_text(stop)} s" + (f" and the formula's times {_listed(named)}" if named else "")


def _listed(times: list[Fraction]) -> str:
    # With more digits than elsewhere: 1.0000001 must not read 1.
    shown = [f"{float(t):.10g}" for t in times[:4]] + (["..."] if len(times) > 4 else [])
    return ", ".join(shown) + " s"


def _text(seconds: Fraction) -> str:
    return f"{float(seconds):.10g}"


def check_steps(stop_time: float, period: float | None, *, key: str | None = None) -> None:
    """Check a period in s, stated at a key or else the FMU's step; SpecError if it is too short."""
    smallest, shorten = stop_time / MAX_STEPS, "shorten it, or "
    why = f"gives more than {MAX_STEPS:,} steps up to the stop time {stop_time:.10g} s"
    if smallest < _SHORTEST_STEP:
        smallest, shorten = _SHORTEST_STEP, ""
        why = "is so short that times count as one; use a model whose time has a larger unit"
    if period is not None and period < smallest:
        named = f"{key.rpartition('.')[2]} =" if key else "the FMU's step"
        remedy = "" if key else f"{shorten}state an output interval: "
        raise SpecError(f"{named} {period:g} s {why}; {remedy}the smallest value is {smallest:g}", key=key)


def default_freedom(formulas: Iterable[Formula], *, stop_time: float, step: float) -> FreeSection:
    """Return limits wide enough for inputs that change several times within each window.

    The shortest piece is a multiple of the time grid's step; all times are in s.
    """
    stop, grid = exact(stop_time), exact(step)
    window = smallest_window(formulas)
    wanted = stop / _FEWEST_PIECES
    if window is not None:
        wanted = min(wanted, exact(window) / _PIECES_PER_WINDOW)
    shortest = max(1, max(wanted, stop / _MOST_PIECES) // grid) * grid
    return FreeSection(max_control_points=max(1, stop // shortest), min_interval=float(shortest))


def smallest_window(formulas: Iterable[Formula]) -> float | None:
    """Return the length in s of the smallest window that is longer than a moment; None if there is none."""
    windows = (window for formula in formulas for window in formula.windows)
    return min((w.end - w.start for w in windows if w.end > w.start), default=None)
