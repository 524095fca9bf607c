"""Everything observed in one sample: what broke or decided it, parts of the formula, signals over time."""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory, is_discrete
from falsifier.evaluation.evaluate import Evaluation, diagnosis_of
from falsifier.llm.prompts.courses import (
    change_list,
    coarse_clock,
    column_decimals,
    course_text,
    dwell_list,
    longest_stretch,
)
from falsifier.llm.prompts.numbers import decimals_for, number, plain
from falsifier.llm.prompts.shapes import MOST_BREAKPOINTS, Course, course, oscillations
from falsifier.llm.prompts.view import View
from falsifier.stl import Diagnosis, Formula, Monitor, Verdict
from falsifier.stl.formula import And, Iff, Implies, Or, Predicate
from falsifier.stl.margins import shown, signed

Array = NDArray[np.float64]

# Digits of robustness values: the search depends on small differences between samples.
ROBUSTNESS_DIGITS = 5
# Distance from a signal that its course may have, as a share of its span: of those compared, of others.
_TOLERANCE = 0.02
_TOLERANCE_OF_OTHERS = 0.04
# Oscillations with a shorter period than this share of the told time are told by their envelopes.
_SLOWEST_OSCILLATION = 1 / 20
# The interval around the critical time that is told more exactly: its share of the told time, its number of
# periods if the signal oscillates, and its tolerance as a share of the span there.
_CLOSE_SHARE = 1 / 12
_CLOSE_PERIODS = 2.5
_CLOSE_TOLERANCE = 0.01
# Breakpoints of signals that the formula does not compare, and of samples that are told in short.
_FEWER_BREAKPOINTS = 12
# Steps of an input at which the course of an output always has a breakpoint, so that its response is seen.
_MOST_STEPS = 8
_SIDES: Mapping[type[Formula], str] = {
    And: "conjuncts",
    Or: "alternatives",
    Implies: "condition and consequence",
    Iff: "sides",
}
# Maximum number of signals shown over time; those of the formula come first.
_MAX_SIGNALS = 16


def summary(evaluation: Evaluation) -> Iterator[str]:
    """One line: when and by which predicate the robustness was decided."""
    verdict = evaluation.verdict
    assert verdict is not None
    yield f"decided at t = {number(verdict.critical_time, 5)} s by {verdict.predicate}"


def facts(view: View, evaluation: Evaluation, *, close: bool = True) -> Iterator[str]:
    """The most important lines: what broke, what decided, robustness of the parts, stays.

    Args:
        view: the problem.
        evaluation: a judged sample.
        close: whether to add all values at the critical time, and when each predicate was false.
    """
    trajectory = evaluation.trajectory
    if trajectory is None:
        yield from summary(evaluation)
        return
    looked_at = _looked_at(view, trajectory)
    monitor = monitor_for(view)
    diagnosis = diagnosis_of(monitor, trajectory)
    clock = _clock(view)
    if evaluation.verdict is not None and evaluation.verdict.breach is not None:
        yield f"what broke: {evaluation.verdict.breach.text}"
    yield f"why: {diagnosis.text}"
    if close:
        yield _values_there(view, trajectory, diagnosis)
    yield from _parts(view, monitor, diagnosis, trajectory)
    for name in view.formula_outputs:
        times, column = looked_at.times, looked_at[name]
        if is_discrete(column, kind=view.kind(name)):
            label = partial(view.labelled, name)
            yield f"{name}: {change_list(times, column, clock=clock, label=label)}"
            if stays := dwell_list(times, column, clock=clock, label=label):
                yield f"{name} stays: {stays}"
    if close:
        for predicate in view.requirement.formula.predicates:
            yield _predicate(view, monitor, predicate, trajectory)


def details(view: View, evaluation: Evaluation, *, close: bool = True) -> Iterator[str]:
    """Lines on signals and terms of the formula over time.

    Args:
        view: the problem.
        evaluation: a sample.
        close: whether to tell all signals, and the deciding ones more exactly around the critical time;
            otherwise only the terms that the formula compares.
    """
    verdict, trajectory = evaluation.verdict, evaluation.trajectory
    if verdict is None or trajectory is None:
        return
    trajectory = _looked_at(view, trajectory)
    times = trajectory.times
    steps = _input_steps(evaluation) if close else ()
    compared = compared_columns(view, trajectory)
    if not close:
        compared = {name: column for name, column in compared.items() if name in _deciding(view, verdict)}
    columns = _shown_columns(view, trajectory, compared) if close else compared
    for name, column in columns.items():
        if is_discrete(column, kind=view.kind(name)):
            if name not in view.formula_outputs:  # facts() shows those
                label = partial(view.labelled, name)
                yield f"{name}: {change_list(times, column, clock=_clock(view), label=label)}"
        else:
            most = MOST_BREAKPOINTS if close and name in compared else _FEWER_BREAKPOINTS
            kept = steps if name in compared else ()
            yield f"{name}: {_drawn(view, name, column, times, kept, most)}"
    if close:
        yield from _close_up(view, compared, times, verdict)


def _looked_at(view: View, trajectory: Trajectory) -> Trajectory:
    """The part of a trajectory at which the requirement looks."""
    end = int(np.searchsorted(trajectory.times, view.looked_at + trajectory.step / 2))
    return Trajectory(trajectory.times[:end], {n: column[:end] for n, column in trajectory.columns.items()})


def _values_there(view: View, trajectory: Trajectory, diagnosis: Diagnosis) -> str:
    there = []
    for name, value in trajectory.at(diagnosis.critical_time).items():
        decimals = _decimals(view, trajectory[name], name, diagnosis.robustness)
        there.append(f"{name} = {view.labelled(name, value, plain(value, decimals))}{_unit(view, name)}")
    return f"all signals at t = {plain(diagnosis.critical_time, _clock(view))} s: {', '.join(there)}"


def monitor_for(view: View) -> Monitor:
    """Monitor of the requirement on its output grid; compiled once per requirement."""
    return _monitor(view.requirement.formula, view.experiment.output_interval, view.experiment.samples)


@lru_cache(maxsize=64)
def _monitor(formula: Formula, step: float, samples: int) -> Monitor:
    return Monitor(formula, step=step, samples=samples)


def _parts(view: View, monitor: Monitor, diagnosis: Diagnosis, trajectory: Trajectory) -> Iterator[str]:
    """Robustness of both sides of every connective on the path to the deciding predicate."""
    above: type[Formula] | None = None
    for step in diagnosis.path:
        kind = type(step.formula)
        is_link = kind is above and kind in (And, Or)  # its chain was shown already, at the first link
        above = kind
        if is_link or not isinstance(step.formula, And | Or | Implies | Iff):
            continue
        sides = _sides(step.formula)
        found = monitor.robustness(trajectory, step.time)
        words = (
            f"{side} robustness {signed(found[side], 4)}{_scale(view, side)}"
            for side in sides
            if side in found
        )
        yield f"{_SIDES[kind]} at t = {plain(step.time, _clock(view))} s: {'; '.join(words)}"


def _sides(formula: Formula) -> list[Formula]:
    """Operands of a connective; a chain of the same connective is flattened."""
    if not isinstance(formula, And | Or):
        return list(formula.children)
    return [
        side
        for child in formula.children
        for side in (_sides(child) if type(child) is type(formula) else [child])
    ]


def _scale(view: View, part: Formula) -> str:
    """Unit of a part's robustness; empty unless all its signals have the same unit."""
    units = {view.unit(name) for name in part.signals}
    return f" {units.pop()}" if len(units) == 1 and units != {""} else ""


def _predicate(view: View, monitor: Monitor, predicate: Predicate, trajectory: Trajectory) -> str:
    """When a predicate was false, among the times at which the requirement asks for it."""
    clock = _clock(view)
    start, end = monitor.window(predicate)
    first, last = round(start / trajectory.step), round(end / trajectory.step)
    margin = monitor.course(trajectory, predicate)[first : last + 1]
    times = trajectory.times[first : last + 1]
    said = f"{predicate}, from {plain(start, clock)} to {plain(end, clock)} s"
    wrong = margin < 0
    stretch = longest_stretch(times, wrong)
    nearest = int(np.abs(margin).argmin())
    if stretch is None:
        near = int(margin.argmin())
        at = plain(float(times[near]), clock)
        return f"{said}: always true, smallest margin {_short(margin[near])} at {at} s"
    if wrong.all():
        return (
            f"{said}: never true, closest at {plain(float(times[nearest]), clock)} s, "
            f"off by {_short(-margin[nearest])}"
        )
    step = trajectory.step
    if int(wrong.sum()) == 1:
        return f"{said}: false only at {plain(stretch[0], clock)} s"
    return (
        f"{said}: false for {number(round(float(wrong.sum()) * step, 6))} s in total, longest from "
        f"{plain(stretch[0], clock)} to {plain(stretch[1], clock)} s"
    )


def _short(margin: float) -> str:
    return f"{shown(margin):.5g}"


def compared_columns(view: View, trajectory: Trajectory) -> dict[str, Array]:
    """What the predicates compare: terms such as ``y5 - y4``, and outputs that stand alone."""
    formula = view.requirement.formula
    sides = {str(side): side for p in formula.predicates for side in (p.left, p.right)}
    columns = {
        text: np.broadcast_to(side.evaluate(trajectory.columns), trajectory.times.shape)
        for text, side in sides.items()
        if set(side.signals) & set(view.formula_outputs)
    }
    return {text: column for text, column in columns.items() if np.isfinite(column).all()}


def _shown_columns(view: View, trajectory: Trajectory, compared: dict[str, Array]) -> dict[str, Array]:
    """What is compared, then the recorded signals; of a problem without input signals, only integers.

    Its parameters act at the start alone, so that the course of everything else decides nothing.
    """
    recorded = (*view.formula_outputs, *(n for n in view.experiment.outputs if n not in view.formula_outputs))
    others = [n for n in recorded if n in trajectory.columns and n not in compared]
    if not view.space.inputs:
        others = [n for n in others if is_discrete(trajectory[n], kind=view.kind(n))]
    columns = compared | {n: trajectory[n] for n in others[: max(0, _MAX_SIGNALS - len(compared))]}
    return {text: column for text, column in columns.items() if np.isfinite(column).all()}


def drawn_course(
    view: View,
    name: str,
    column: Array,
    times: Array,
    steps: Sequence[float] = (),
    most: int = MOST_BREAKPOINTS,
) -> Course:
    """What is told of a signal over the whole simulation."""
    in_formula = name in view.requirement.formula.signals or name not in view.info
    share = _TOLERANCE if in_formula else _TOLERANCE_OF_OTHERS
    slowest = _SLOWEST_OSCILLATION * float(times[-1])
    tolerance = share * float(np.ptp(column))
    return course(times, column, tolerance=tolerance, slower_than=slowest, kept=steps, most=most)


def course_line(view: View, drawn: Course, column: Array) -> str:
    """The text of such a course."""
    decimals = decimals_for(_TOLERANCE * float(np.ptp(column)), 1)
    return course_text(drawn, decimals=decimals, clock=coarse_clock(view.space.stop_time))


def _drawn(view: View, name: str, column: Array, times: Array, steps: Sequence[float], most: int) -> str:
    if np.ptp(column) == 0:
        return f"constant {plain(float(column[0]), column_decimals(column))}"
    return course_line(view, drawn_course(view, name, column, times, steps, most), column)


def _close_up(view: View, compared: Mapping[str, Array], times: Array, verdict: Verdict) -> Iterator[str]:
    """What the deciding predicate compares, more exactly around the critical time."""
    for name, column in compared.items():
        if name not in _deciding(view, verdict) or is_discrete(column, kind=view.kind(name)):
            continue
        reach = _CLOSE_SHARE / 2 * float(times[-1])
        swings = oscillations(times, column, slower_than=_SLOWEST_OSCILLATION * float(times[-1]))
        around = [s for s in swings if s.start <= verdict.critical_time <= s.end]
        if around:
            reach = _CLOSE_PERIODS / 2 * around[0].period_at(verdict.critical_time)
        inside = np.abs(times - verdict.critical_time) <= max(reach, 4 * view.experiment.output_interval)
        part = column[inside]
        if np.ptp(part) == 0:
            continue
        drawn = course(
            times[inside],
            part,
            tolerance=_CLOSE_TOLERANCE * float(np.ptp(part)),
            slower_than=0.0,
            kept=(verdict.critical_time,),
        )
        decimals = max(
            _decimals(view, column, name, verdict.robustness),
            decimals_for(_CLOSE_TOLERANCE * float(np.ptp(part)), 1),
        )
        shown = course_text(drawn, decimals=decimals, clock=_clock(view))
        yield f"{name} around t = {plain(verdict.critical_time, _clock(view))} s: {shown}"


def _input_steps(evaluation: Evaluation) -> tuple[float, ...]:
    """Times at which inputs step, if they are few."""
    found = sorted(
        {
            time
            for signal in evaluation.candidate.signals.values()
            if signal.interpolation == "constant"
            for time, before, after in zip(signal.times[1:], signal.values, signal.values[1:], strict=False)
            if before != after
        }
    )
    return tuple(found) if len(found) <= _MOST_STEPS else ()


def _deciding(view: View, verdict: Verdict) -> set[str]:
    """What the deciding predicate compares."""
    formula = view.requirement.formula
    deciding = [p for p in formula.predicates if str(p) == verdict.predicate] or list(formula.predicates)
    return {str(side) for p in deciding for side in (p.left, p.right)}


def _decimals(view: View, column: Array, name: str, robustness: float) -> int:
    """Decimals of a signal: more for signals of the formula, whose margin must be visible."""
    in_formula = name in view.requirement.formula.signals or name not in view.info
    return column_decimals(column, margin=abs(robustness) if in_formula else None)


def _clock(view: View) -> int:
    """Decimals of times: enough for the output grid, because all times shown are sample times."""
    return min(
        6, max(decimals_for(view.space.stop_time, 4), decimals_for(view.experiment.output_interval, 1))
    )


def _unit(view: View, name: str) -> str:
    unit = view.unit(name)
    return f" {unit}" if unit else ""
