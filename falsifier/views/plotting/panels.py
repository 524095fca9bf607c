"""What to draw of one simulation, as values: compared quantities with their bounds, then inputs.

Figures of results, reports and notebooks are drawn from these panels.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Range, number_names
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import with_unit
from falsifier.stl import Formula
from falsifier.stl.breach import compared_sides
from falsifier.stl.expression import Expression, unit_of
from falsifier.stl.formula import Predicate, Temporal, Until
from falsifier.stl.monitor import Verdict

Array = NDArray[np.float64]

# Values beyond this are drawn at this level: the height of a picture must not overflow.
_LARGEST_DRAWN = 1e300


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """The bound that a predicate sets on a quantity, and the time window in which it is evaluated."""

    predicate: str  # text of the predicate
    start: float  # earliest time in s at which it is evaluated
    end: float  # latest time in s at which it is evaluated
    values: Array  # the bound at the panel's times, shape (n,)


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One quantity over time."""

    title: str  # name of the quantity, with its unit if known
    times: Array  # in s, shape (n,)
    values: Array  # values at these times, shape (n,)
    bounds: tuple[Bound, ...] = ()  # what it is compared with; empty for inputs
    # Time in s to mark if this quantity broke, or if nothing broke and it decided the verdict.
    critical: float | None = None
    # Critical time in s if this quantity decided the verdict, but another one broke.
    decided: float | None = None
    # Intervals in s over which a comparison of it did not hold; of several, the worst one.
    broken: tuple[tuple[float, float], ...] = ()
    points: tuple[tuple[float, float], ...] = ()  # control points (time, value) of an input
    limits: tuple[float, float] | None = None  # range of an input
    steps: bool = False  # whether values are held until the next sample
    # Names of its numbers if these are whole, empty if they have none; None for real values.
    labels: Mapping[int, str] | None = None
    # Component of a system that it belongs to; empty for other models, and for what several share.
    component: str = ""


def panels(
    formula: Formula,
    trajectory: Trajectory,
    candidate: Candidate,
    inputs: Sequence[Range],
    verdict: Verdict | None,
    labels: Mapping[str, Mapping[int, str]],
    components: Sequence[str] = (),
) -> list[Panel]:
    """Make the panels of one simulation: one per compared quantity, then one per searched input.

    Those of a system are grouped by component, after quantities of several components. Labels are names of
    the numbers of other signals that are not real, by signal.
    """
    labels = {**labels, **{r.name: number_names(r.kind, r.items) for r in inputs if r.kind != "real"}}
    compared: dict[Expression, _Judged] = {}
    for predicate, window in judged_windows(formula):
        compared.setdefault(compared_sides(predicate)[0], []).append((predicate, window))
    drawn = [(str(e), e.signals, _quantity(trajectory, e, judged, verdict)) for e, judged in compared.items()]
    drawn += [(r.name, (r.name,), _input(r, trajectory, candidate)) for r in inputs]
    shown = [
        replace(
            panel,
            component=_owner(signals, components),
            labels=labels.get(name),
            steps=panel.steps or name in labels,
        )
        for name, signals, panel in drawn
    ]
    place = {name: k for k, name in enumerate(components)}
    return sorted(shown, key=lambda panel: place.get(panel.component, -1))


def _owner(signals: Iterable[str], components: Sequence[str]) -> str:
    """Return the component that all these signals belong to; empty if there is none."""
    found = {
        max((c for c in components if signal.startswith(f"{c}.")), key=len, default="") for signal in signals
    }
    return found.pop() if len(found) == 1 else ""


def judged_windows(
    formula: Formula, start: float = 0.0, end: float = 0.0
) -> Iterator[tuple[Predicate, tuple[float, float]]]:
    """Yield each predicate with the earliest and latest time in s at which it is evaluated.

    Unbounded operators extend to infinity.
    """
    if isinstance(formula, Predicate):
        yield formula, (start, end)
        return
    if isinstance(formula, Temporal):
        window = formula.window
        begin, finish = (window.start, window.end) if window else (0.0, np.inf)
        if isinstance(formula, Until):  # its left operand counts from its own time on
            yield from judged_windows(formula.left, start, end + finish)
            yield from judged_windows(formula.right, start + begin, end + finish)
            return
        start, end = start + begin, end + finish
    for child in formula.children:
        yield from judged_windows(child, start, end)


_Judged = list[tuple[Predicate, tuple[float, float]]]


def _quantity(
    trajectory: Trajectory, expression: Expression, judged: _Judged, verdict: Verdict | None
) -> Panel:
    end = float(trajectory.times[-1])
    bounds = tuple(
        Bound(str(p), begin, min(finish, end), _evaluated(compared_sides(p)[1], trajectory))
        for p, (begin, finish) in judged
    )
    predicates = {bound.predicate for bound in bounds}
    decided = verdict.critical_time if verdict and verdict.predicate in predicates else None
    shortfalls = verdict.breach.shortfalls if verdict and verdict.breach else ()
    own = [shortfall for shortfall in shortfalls if shortfall.quantity == str(expression)]
    return Panel(
        with_unit(str(expression), unit_of(expression, trajectory.units)),
        trajectory.times,
        _evaluated(expression, trajectory),
        bounds,
        critical=own[0].time if own else None if shortfalls else decided,
        decided=decided if shortfalls and not own else None,
        broken=tuple((shortfall.start, shortfall.end) for shortfall in own),
    )


def _input(r: Range, trajectory: Trajectory, candidate: Candidate) -> Panel:
    signal = candidate.signals[r.name].stepped(float(trajectory.times[-1]))
    return Panel(
        with_unit(r.name, r.unit),
        trajectory.times,
        _drawable(signal.held(None).sample(trajectory.times)),
        points=tuple(zip(signal.times, map(float, _drawable(signal.values)), strict=True)),
        limits=(float(_drawable(r.low)), float(_drawable(r.high))),
        steps=signal.interpolation == "constant",
    )


def _evaluated(expression: Expression, trajectory: Trajectory) -> Array:
    return np.broadcast_to(_drawable(expression.evaluate(trajectory.columns)), trajectory.times.shape)


def _drawable(values: ArrayLike) -> Array:
    return np.clip(np.asarray(values, dtype=np.float64), -_LARGEST_DRAWN, _LARGEST_DRAWN)
