"""Signals of a sample over time: which are told, and how exactly."""

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts import courses
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.numbers import coarse_clock, column_decimals, fine_clock, plain
from falsifier.llm.prompts.view import View
from falsifier.stl import Verdict
from falsifier.stl.expression import Arithmetic, Call, Expression, Name, Number

# Distance from a signal that its course may have, as a share of its span: of those compared, of others.
TOLERANCE = 0.02
TOLERANCE_OF_OTHERS = 0.04
# Share of its span within which a course must be told to be told at all.
_COARSEST, _COARSEST_OF_OTHERS = 0.3, 0.15
# What is compared is told more exactly near its threshold: as a share of the distance to it, but no more
# exactly than a share of the span.
_OF_DISTANCE = 1 / 3
_FINEST = 0.002
# Oscillations with a shorter period than this share of the told time are told by their envelopes.
_SLOWEST_OSCILLATION = 1 / 20
# The interval around the critical time that is told more exactly: its share of the told time, its number of
# periods if the signal oscillates, and its tolerance as a share of the span there.
_CLOSE_SHARE = 1 / 12
_CLOSE_PERIODS = 2.5
CLOSE_TOLERANCE = 0.01
# A longest failure that takes more than this share of the told time is not told more exactly.
_LONGEST_CLOSE = 0.5
# What changes by no more than this share of the robustness in that interval is not told there.
_AT_REST = 0.01
# Breakpoints of signals that the formula does not compare, and of those of samples that are told in short.
_BREAKPOINTS_OF_OTHERS, FEWER_BREAKPOINTS = 24, 16
# Steps of an input at which the course of an output always has a breakpoint, so that its response is seen.
_MOST_STEPS = 8
# Maximum number of signals that are not discrete over time; all that are compared come first.
_MAX_SIGNALS = 16


def continuous(view: View, evaluation: Evaluation, inside: Trajectory) -> Iterator[str]:
    """Courses of what is compared and of other signals."""
    steps = _input_steps(view, evaluation)
    for name, column in _shown_columns(view, inside).items():
        is_judged = _is_judged(view, name)
        most = courses.MOST_BREAKPOINTS if is_judged else _BREAKPOINTS_OF_OTHERS
        yield f"{name}: {drawn(view, name, inside, column, steps if is_judged else (), most)}"


def compared_columns(view: View, trajectory: Trajectory) -> dict[str, Array]:
    """What the predicates compare: terms such as ``y5 - y4``, and outputs that stand alone."""
    columns = {
        text: np.broadcast_to(side.evaluate(trajectory.columns), trajectory.times.shape)
        for text, side in view.compared.items()
        if set(side.signals) & set(view.formula_outputs)
    }
    return {text: column for text, column in columns.items() if np.isfinite(column).all()}


def _shown_columns(view: View, trajectory: Trajectory) -> dict[str, Array]:
    """What is compared and other recorded signals, unless discrete; no others if there are no input signals.

    Parameters act at the start alone, so that the course of everything else decides nothing. Nor is the
    absolute value of a signal told beside the signal.
    """
    compared = compared_columns(view, trajectory)
    found = {n: trajectory[n] for n in view.recorded if view.space.inputs and n in trajectory.columns}
    others = [n for n, c in found.items() if n not in compared and not view.is_discrete(n, c)]
    compared = {text: c for text, c in compared.items() if not _is_folded(view.compared[text], others)}
    columns = compared | {n: found[n] for n in others[: max(0, _MAX_SIGNALS - len(compared))]}
    return {n: c for n, c in columns.items() if np.isfinite(c).all() and not view.is_discrete(n, c)}


def _is_folded(side: Expression, told: Collection[str]) -> bool:
    """Whether a term is the absolute value of a signal, or of it and a number, that is told itself."""
    if not (isinstance(side, Call) and side.function == "abs" and len(side.signals) == 1):
        return False
    (inner,) = side.operands
    parts: tuple[Expression, ...] = (inner,)
    if isinstance(inner, Arithmetic) and inner.operator in ("+", "-"):
        parts = inner.left, inner.right
    return all(isinstance(part, Name | Number) for part in parts) and side.signals[0] in told


def told_accuracy(view: View, name: str, column: Array) -> float:
    """Distance from a signal, in its unit, up to which its course says nothing of being less exact."""
    return (TOLERANCE if _is_judged(view, name) else TOLERANCE_OF_OTHERS) * float(np.ptp(column))


def drawn(view: View, name: str, inside: Trajectory, column: Array, steps: Sequence[float], most: int) -> str:
    """What is told of a signal, or of what is compared, over the time at which the requirement looks."""
    if np.ptp(column) == 0:
        return f"constant {plain(float(column[0]), column_decimals(column))}"
    claimed = told_accuracy(view, name, column)
    wanted = np.full_like(inside.times, claimed)
    for predicate in view.requirement.formula.predicates:
        if name in map(str, predicate.sides):
            # There may be no margin where the requirement does not look.
            wanted = np.fmin(wanted, _OF_DISTANCE * np.abs(predicate.margin(inside.columns)))
    return courses.course(
        inside.times,
        column,
        clock=coarse_clock(view.space.stop_time),
        tolerance=np.maximum(wanted, _FINEST * float(np.ptp(column))),
        claimed=claimed,
        slower_than=_SLOWEST_OSCILLATION * float(inside.times[-1]),
        kept=steps,
        most=most,
        coarsest=_COARSEST if _is_judged(view, name) else _COARSEST_OF_OTHERS,
    )


def close_up(
    view: View,
    verdict: Verdict,
    inside: Trajectory,
    deciding: Mapping[str, Array],
    failure: tuple[float, float] | None,
) -> Iterator[str]:
    """What the deciding predicate compares, more exactly around the critical time.

    If there is a longest failure of what must recur, given by its first and last time in s, around that.
    """
    critical, clock = verdict.critical_time, fine_clock(view)
    first, last = failure or (critical, critical)
    where = f"t = {plain(critical, clock)} s"
    if failure:
        where = f"the longest failure, from {plain(first, clock)} to {plain(last, clock)} s"
    if last - first > _LONGEST_CLOSE * float(inside.times[-1]):
        return
    for name, column in deciding.items():
        near = close_up_times(view, inside.times, column, first, last)
        part = column[near]
        if np.ptp(part) <= _AT_REST * abs(verdict.robustness):
            continue
        visible = 10.0 ** -decimals_of(view, column, name, verdict.robustness)
        claimed = CLOSE_TOLERANCE * float(np.ptp(part))
        told = courses.course(
            inside.times[near],
            part,
            clock=clock,
            # Less than is claimed if the margin would not be visible.
            tolerance=min(claimed, max(visible, _FINEST * float(np.ptp(part)))),
            claimed=claimed,
            slower_than=0.0,
            kept=(first, last),
            coarsest=_COARSEST,
        )
        yield f"{name} around {where}: {told}"


def close_up_times(view: View, times: Array, column: Array, first: float, last: float) -> NDArray[np.bool_]:
    """Which times are told more exactly: from first to last, and a share of all, or a few periods, beside."""
    reach = _CLOSE_SHARE / 2 * float(times[-1])
    swings = courses.oscillations(times, column, slower_than=_SLOWEST_OSCILLATION * float(times[-1]))
    around = [s for s in swings if s.start <= first <= s.end]
    if around:
        reach = _CLOSE_PERIODS / 2 * around[0].periods[0]
    reach = max(reach, 4 * view.experiment.output_interval)
    return np.asarray((first - times <= reach) & (times - last <= reach))


def _input_steps(view: View, evaluation: Evaluation) -> tuple[float, ...]:
    """Times at which inputs step, if they are few."""
    signals = (s.stepped(view.space.stop_time) for s in evaluation.candidate.signals.values())
    found = sorted({time for s in signals if s.interpolation == "constant" for time in s.switch_times})
    return tuple(found) if len(found) <= _MOST_STEPS else ()


def deciding_columns(view: View, verdict: Verdict, inside: Trajectory) -> dict[str, Array]:
    """What the deciding predicate compares, unless it is discrete; of an absolute value the signal."""
    predicates = view.requirement.formula.predicates
    deciding = [p for p in predicates if str(p) == verdict.predicate] or predicates
    sides = {str(side): side for p in deciding for side in p.sides}
    columns = {text: c for text, c in compared_columns(view, inside).items() if text in sides}
    for text, side in sides.items():
        if text in columns and _is_folded(side, view.recorded):
            del columns[text]
            columns |= {name: inside[name] for name in side.signals}
    return {text: c for text, c in columns.items() if not view.is_discrete(text, c)}


def decimals_of(view: View, column: Array, name: str, robustness: float) -> int:
    """Decimals of a signal: more for signals of the formula, whose margin must be visible."""
    return column_decimals(column, margin=abs(robustness) if _is_judged(view, name) else None)


def _is_judged(view: View, name: str) -> bool:
    """Whether the formula names a signal; what is compared and is no signal is a term of the formula."""
    return name in view.requirement.formula.signals or name not in view.info
