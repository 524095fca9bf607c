"""Everything observed in one sample: what decided it, the parts of the formula, all signals over time."""

from collections.abc import Iterator, Mapping
from functools import lru_cache
from math import ceil, floor, log10

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.courses import (
    change_list,
    column_decimals,
    dwell_list,
    extrema,
    is_discrete,
    longest_stretch,
    oscillation,
    samples_at,
)
from falsifier.llm.prompts.numbers import decimals_for, number, plain, signed
from falsifier.llm.prompts.view import View
from falsifier.stl import Diagnosis, Formula, Monitor, Verdict
from falsifier.stl.formula import And, Iff, Implies, Or, Predicate

Array = NDArray[np.float64]

# Digits of robustness values: the search depends on small differences between samples.
ROBUSTNESS_DIGITS = 5
# Maximum number of values of each signal over the whole simulation.
_GRID_VALUES = 21
# A burst is a densely sampled interval around the critical time: its share of the stop time, its usual number
# of steps, its maximum number of values, and the values per period if the signal oscillates.
_BURST_SHARE = 1 / 25
_BURST_STEPS = 20
_BURST_VALUES = 40
_VALUES_PER_PERIOD = 8
# Maximum number of signals shown over time; those of the formula come first.
_MAX_SIGNALS = 16


def facts(view: View, evaluation: Evaluation) -> Iterator[str]:
    """The most important lines: what decided, all values at that time, robustness of the parts, stays."""
    verdict, trajectory = evaluation.verdict, evaluation.trajectory
    assert verdict is not None
    if trajectory is None:
        yield f"decided at t = {number(verdict.critical_time)} s by {verdict.predicate}"
        return
    monitor = monitor_for(view)
    diagnosis = monitor.diagnose(trajectory)
    clock = _clock(view)
    yield f"why: {diagnosis.text}"
    there = []
    for name, value in trajectory.at(diagnosis.critical_time).items():
        decimals = _decimals(view, trajectory[name], name, verdict.robustness)
        there.append(f"{name} = {plain(value, decimals)}{_unit(view, name)}")
    yield f"all signals at t = {plain(diagnosis.critical_time, clock)} s: {', '.join(there)}"
    yield from _parts(view, monitor, diagnosis, trajectory)
    for name in view.formula_outputs:
        if is_discrete(trajectory[name], kind=view.kind(name)):
            yield f"{name}: {change_list(trajectory.times, trajectory[name], clock=clock)}"
            if stays := dwell_list(trajectory.times, trajectory[name], clock=clock):
                yield f"{name} stays: {stays}"
    for predicate in view.requirement.formula.predicates:
        yield _predicate(predicate, monitor.course(trajectory, predicate), trajectory, clock)


def details(view: View, evaluation: Evaluation) -> Iterator[str]:
    """Lines on all signals and terms of the formula over time, densely sampled around the critical time."""
    verdict, trajectory = evaluation.verdict, evaluation.trajectory
    if verdict is None or trajectory is None:
        return
    step = grid_step(view.space.stop_time)
    grid = np.arange(0.0, view.space.stop_time * (1 + 1e-9), step)
    columns = _shown_columns(view, trajectory)
    yield f"values every {number(step)} s from t = 0:"
    for name, column in columns.items():
        yield from _course(view, name, column, trajectory.times, grid, verdict.robustness)
    yield from _burst(view, columns, trajectory.times, verdict)


def monitor_for(view: View) -> Monitor:
    """Monitor of the requirement on its output grid; compiled once per requirement."""
    return _monitor(view.requirement.formula, view.experiment.output_interval, view.experiment.samples)


@lru_cache(maxsize=64)
def _monitor(formula: Formula, step: float, samples: int) -> Monitor:
    return Monitor(formula, step=step, samples=samples)


def grid_step(stop_time: float) -> float:
    """Round step in s that divides the simulated time into at most twenty parts.

    >>> grid_step(50.0), grid_step(40.0), grid_step(0.3)
    (2.5, 2.0, 0.02)
    """
    least = stop_time / (_GRID_VALUES - 1)
    power = 10.0 ** floor(log10(least))
    chosen = next(m for m in (1, 2, 2.5, 5, 10) if m * power >= least * (1 - 1e-9))
    return float(f"{chosen * power:.3g}")


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
        name = {And: "conjuncts", Or: "alternatives", Implies: "condition and consequence", Iff: "sides"}
        yield f"{name[kind]} at t = {plain(step.time, _clock(view))} s: {'; '.join(words)}"


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


def _predicate(predicate: Predicate, margin: Array, trajectory: Trajectory, clock: int) -> str:
    times = trajectory.times[: len(margin)]
    wrong = margin < 0
    stretch = longest_stretch(times, wrong)
    nearest = int(np.abs(margin).argmin())
    if stretch is None:
        near = int(margin.argmin())
        return (
            f"{predicate}: always true, smallest margin {_short(margin[near])} "
            f"at {plain(float(times[near]), clock)} s"
        )
    if wrong.all():
        return (
            f"{predicate}: never true, closest at {plain(float(times[nearest]), clock)} s, "
            f"off by {_short(-margin[nearest])}"
        )
    step = trajectory.step
    return (
        f"{predicate}: false for {number(round(float(wrong.sum()) * step, 6))} s in total, longest from "
        f"{plain(stretch[0], clock)} to {plain(stretch[1], clock)} s"
    )


def _short(margin: float) -> str:
    return f"{margin:.5g}"


def _shown_columns(view: View, trajectory: Trajectory) -> dict[str, Array]:
    """Signals of the formula, its terms, then other recorded signals; the LLM knows the searched inputs."""
    formula = view.requirement.formula
    terms = {str(e): e.evaluate(trajectory.columns) for e in formula.expressions}
    others = [n for n in view.experiment.outputs if n in trajectory.columns and n not in formula.signals]
    columns = {n: trajectory[n] for n in view.formula_outputs} | {
        text: np.broadcast_to(column, trajectory.times.shape) for text, column in terms.items()
    }
    columns |= {n: trajectory[n] for n in others[: max(0, _MAX_SIGNALS - len(columns))]}
    return {text: column for text, column in columns.items() if np.isfinite(column).all()}


def _course(
    view: View, name: str, column: Array, times: Array, grid: Array, robustness: float
) -> Iterator[str]:
    clock = _clock(view)
    if is_discrete(column, kind=view.kind(name)):
        if name not in view.formula_outputs:  # facts() shows those
            yield f"{name}: {change_list(times, column, clock=clock)}"
        return
    decimals = _decimals(view, column, name, robustness)
    seen = extrema(times, column, decimals=decimals, clock=clock)
    if seen.startswith("constant"):
        yield f"{name}: {seen}"
        return
    usual = column_decimals(column)
    yield f"{name}: {samples_at(times, column, grid.tolist(), decimals=usual)}; {seen}"
    fast = oscillation(times, column, slower_than=float(grid[1] - grid[0]))
    if fast is not None:
        span = f"from {plain(fast.start, clock)} to {plain(fast.end, clock)} s"
        yield (
            f"{name} oscillates {span} with a period of about {fast.period:.2g} s and a peak-to-peak "
            f"amplitude of about {fast.swing:.2g}; the values above are too far apart to show it"
        )


def _burst(view: View, columns: Mapping[str, Array], times: Array, verdict: Verdict) -> Iterator[str]:
    """Signals and terms of the deciding predicate, densely sampled around the critical time."""
    shown = {
        name: column
        for name, column in columns.items()
        if name in _deciding(view, verdict) and not is_discrete(column, kind=view.kind(name))
    }
    if not shown or all(np.ptp(column) == 0 for column in shown.values()):
        return
    interval = view.experiment.output_interval
    step = max(1, round(_burst_step(view, shown, times) / interval)) * interval
    usual_reach = max(view.space.stop_time * _BURST_SHARE, _BURST_STEPS * step) / 2
    reach = min(usual_reach, _BURST_VALUES // 2 * step)
    first = max(0, ceil((verdict.critical_time - reach) / step - 1e-9))
    last = floor(min(view.space.stop_time, verdict.critical_time + reach) / step + 1e-9)
    moments = [k * step for k in range(first, last + 1)]
    yield f"values every {number(step, 6)} s from t = {number(moments[0], 6)} s:"
    for name, column in shown.items():
        decimals = _decimals(view, column, name, verdict.robustness)
        yield f"{name}: {samples_at(times, column, moments, decimals=decimals)}"


def _burst_step(view: View, columns: Mapping[str, Array], times: Array) -> float:
    """Step in s: small enough for the fastest oscillation, otherwise the usual share of the burst."""
    usual = view.space.stop_time * _BURST_SHARE / _BURST_STEPS
    found = [oscillation(times, column, slower_than=4 * usual) for column in columns.values()]
    return min([usual, *(fast.period / _VALUES_PER_PERIOD for fast in found if fast is not None)])


def _deciding(view: View, verdict: Verdict) -> set[str]:
    """Names of the signals and terms that the deciding predicate compares."""
    formula = view.requirement.formula
    deciding = [p for p in formula.predicates if str(p) == verdict.predicate] or list(formula.predicates)
    sides = {str(side) for p in deciding for side in (p.left, p.right)}
    return sides | {name for p in deciding for name in p.signals}


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
