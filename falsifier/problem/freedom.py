"""The default limits of a free parameterization, for inputs whose control points nobody stated."""

from collections.abc import Iterable

from falsifier.errors import FormulaError
from falsifier.problem.grid import exact
from falsifier.problem.sections import FreeSection
from falsifier.stl import Formula, parse
from falsifier.stl.formula import Window

# An input that changes this often within the formula's smallest window can meet each of its conditions.
_PIECES_PER_WINDOW = 10
# Minimum number of pieces if the windows ask for fewer, and their maximum number.
_FEWEST_PIECES = 200
_MOST_PIECES = 1000


def default_freedom(formulas: Iterable[str], *, stop_time: float, step: float) -> FreeSection:
    """Return limits wide enough for inputs that change several times within each window.

    Args:
        formulas: the formulas; those that cannot be parsed have no windows.
        stop_time: end of the simulation in s.
        step: step of the time grid in s; the shortest piece is a multiple of it.
    """
    stop, grid = exact(stop_time), exact(step)
    window = smallest_window(formulas)
    wanted = stop / _FEWEST_PIECES
    if window is not None:
        wanted = min(wanted, exact(window) / _PIECES_PER_WINDOW)
    shortest = max(1, max(wanted, stop / _MOST_PIECES) // grid) * grid
    return FreeSection(max_control_points=max(1, stop // shortest), min_interval=float(shortest))


def smallest_window(formulas: Iterable[str | Formula]) -> float | None:
    """Return the length in s of the smallest window that is longer than a moment; None if there is none."""
    windows: list[Window | None] = []
    for formula in formulas:
        try:
            parsed = parse(formula) if isinstance(formula, str) else formula
        except FormulaError:
            continue
        windows += [getattr(part, "window", None) for part in parsed.walk()]
    return min((w.end - w.start for w in windows if w is not None and w.end > w.start), default=None)
