"""Everything observed in one sample: what broke or decided it, parts of the formula, signals over time."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import inf

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.core.words import in_unit, listed
from falsifier.evaluation.evaluate import Evaluation, compiled
from falsifier.llm.prompts import courses
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.numbers import coarse_clock, column_decimals, fine_clock, number, plain
from falsifier.llm.prompts.together import Side, asked_for, closest, longest_failure, near_misses
from falsifier.llm.prompts.view import View
from falsifier.stl import Diagnosis, Formula, Verdict
from falsifier.stl.diagnosis import links
from falsifier.stl.expression import Arithmetic, Call, Expression, Name, Number
from falsifier.stl.formula import And, Iff, Implies, Or
from falsifier.stl.margins import shown, signed

# Digits of robustness values: the search depends on small differences between samples.
ROBUSTNESS_DIGITS = 5
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
# What changes by no more than this share of the robustness in that interval is not told there.
_AT_REST = 0.01
# Breakpoints of signals that the formula does not compare, and of those of samples that are told in short.
_BREAKPOINTS_OF_OTHERS, _FEWER_BREAKPOINTS = 24, 16
# Steps of an input at which the course of an output always has a breakpoint, so that its response is seen.
_MOST_STEPS = 8
_SIDES: Mapping[type[Formula], str] = {
    And: "conjuncts",
    Or: "alternatives",
    Implies: "condition and consequence",
    Iff: "sides",
}
_MARGIN = re.compile(r" by [^ ]+$")
# Maximum number of signals that are not discrete over time; all that are compared come first.
_MAX_SIGNALS = 16


@dataclass(frozen=True, slots=True)
class Signs:
    """What a judged sample shows by which samples are ranked and advice is given."""

    is_timed: bool = False  # whether what decided changed over time, so that its time tells something
    failure: float = 0.0  # s for which what must recur failed in one piece; 0 if nothing must
    # How far each of what must happen together was from it at best, below 0 if it did.
    closest: Mapping[Side, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Observed:
    """What is seen of one judged sample, in lines; more of it, less of it, and in one line; and its signs."""

    full: tuple[str, ...]
    short: tuple[str, ...]
    line: str
    signs: Signs = field(default_factory=Signs)


def observed(view: View, evaluation: Evaluation) -> Observed:
    """Look at a judged sample once.

    All of it tells what broke and what decided, the parts of the formula, when each predicate was false and
    when a violation was nearest, all signals over time, and those that decided more exactly around that time.
    Less of it tells of signals only the discrete ones, and what was compared where it was decided over time.
    """
    verdict, trajectory = evaluation.verdict, evaluation.trajectory
    assert verdict is not None
    line = f"decided at t = {plain(verdict.critical_time, fine_clock(view))} s by {verdict.predicate}"
    if trajectory is None:
        return Observed((line,), (line,), line)
    grid = view.experiment
    monitor = compiled(view.requirement.formula, grid.output_interval, grid.samples)
    diagnosis = monitor.diagnose(trajectory)
    over_time = monitor.courses(trajectory)
    is_timed = any(np.ptp(trajectory[name]) > 0 for name in diagnosis.path[-1].formula.signals)
    reasons = tuple(_reasons(verdict, diagnosis, is_timed=is_timed))
    told_parts = tuple(_parts(view, diagnosis, over_time))
    parts = tuple(text for text, _ in told_parts)
    there = (_values_at(view, trajectory, verdict.critical_time, verdict.robustness),) if is_timed else ()
    predicates = [
        *_predicates(view, diagnosis, trajectory, over_time),
        *_nearest(view, trajectory, over_time),
    ]
    if failure := longest_failure(view.requirement.formula, trajectory.times, over_time):
        values = _values_at(view, trajectory, failure[1], verdict.robustness)
        predicates.append(f"at the end of the longest failure in one piece, {values}")
    inside = view.inside(trajectory)
    discrete = tuple(_discrete(view, inside))
    deciding = _deciding(view, verdict, inside)
    continuous = (*_continuous(view, evaluation, inside), *_close_up(view, evaluation, inside, deciding))
    few_courses = (f"{n}: {_drawn(view, n, inside, c, (), _FEWER_BREAKPOINTS)}" for n, c in deciding.items())
    return Observed(
        (*reasons, *there, *parts, *discrete, *predicates, *continuous),
        (*reasons, *parts, *discrete, *predicates, *few_courses),
        "; ".join((line, *(brief for _, brief in told_parts[:1]))),
        Signs(
            is_timed=is_timed,
            failure=failure[1] - failure[0] if failure else 0.0,
            closest=closest(view.requirement.formula, over_time),
        ),
    )


def _reasons(verdict: Verdict, diagnosis: Diagnosis, *, is_timed: bool) -> Iterator[str]:
    """What broke, and what decided unless that is the same; the margin is the robustness, which is told."""
    breach = verdict.breach
    if breach is not None:
        yield f"what broke: {breach.text}"
        broke = breach.main
        is_decider = (broke.part, broke.time) == (verdict.predicate, diagnosis.critical_time)
        if is_decider and not broke.never and len(breach.shortfalls) == 1 and not diagnosis.vacuities:
            return
    *above, decider = (step.text for step in diagnosis.path if step.text)
    path = "; ".join(above) + ": " * bool(above)
    decider = _MARGIN.sub("", decider)
    decided = f"{path}{decider}" if is_timed else f"{decider} at all times"
    yield " ".join((f"why: {decided}.", *(v.text for v in diagnosis.vacuities)))


def _discrete(view: View, inside: Trajectory) -> Iterator[str]:
    """Changes of all discrete signals, and stays of those in the formula."""
    for name, column in view.discrete(inside).items():
        clock, label = fine_clock(view), partial(view.labelled, name)
        yield f"{name}: {courses.change_list(inside.times, column, clock=clock, label=label)}"
        stays = courses.dwell_list(inside.times, column, clock=clock, label=label)
        if name in view.formula_outputs and stays:
            yield f"{name} stays: {stays}"


def _continuous(view: View, evaluation: Evaluation, inside: Trajectory) -> Iterator[str]:
    """Courses of what is compared and of other signals."""
    steps = _input_steps(view, evaluation)
    for name, column in _shown_columns(view, inside).items():
        is_judged = _is_judged(view, name)
        most = courses.MOST_BREAKPOINTS if is_judged else _BREAKPOINTS_OF_OTHERS
        yield f"{name}: {_drawn(view, name, inside, column, steps if is_judged else (), most)}"


def _values_at(view: View, trajectory: Trajectory, time: float, robustness: float) -> str:
    there = []
    told = {*view.recorded, *(r.name for r in view.space.inputs), *(v.name for v in view.info.inputs)}
    for name, value in trajectory.at(time).items():
        if name not in told:  # a search may record more
            continue
        decimals = _decimals(view, trajectory[name], name, robustness)
        told_value = view.labelled(name, value, plain(value, decimals))
        there.append(f"{name} = {in_unit(told_value, view.variable(name).unit)}")
    all_of_them = "all " * (not view.untold)
    return f"{all_of_them}signals at t = {plain(time, fine_clock(view))} s: {', '.join(there)}"


def _nearest(view: View, trajectory: Trajectory, over_time: Mapping[Formula, Array]) -> Iterator[str]:
    """How close the others came to what is needed while some did what must happen together."""
    clock = fine_clock(view)
    violation = Side(view.requirement.formula, must_hold=False)
    for met, missing, sample in near_misses(violation, trajectory.times, over_time):
        words = []
        for side in missing:
            gaps, found = asked_for(side, trajectory.times, over_time, np.array([sample]))
            word = _part_text(view, side.part, over_time, sample)
            if 0 < gaps[0] < inf:
                did = Side(side.part.children[0], side.must_hold)
                word += f" ({did} at {plain(float(found[0]), clock)} s)"
            words.append(word)
        time = plain(trajectory.times[sample], clock)
        yield f"nearest to a violation while {listed([*map(str, met)])}, at t = {time} s: {'; '.join(words)}"


def _parts(view: View, diagnosis: Diagnosis, over_time: Mapping[Formula, Array]) -> Iterator[tuple[str, str]]:
    """Robustness of both sides of every connective on the path to what decided; the same in numbers alone."""
    above: type[Formula] | None = None
    for step in diagnosis.path:
        kind = type(step.formula)
        is_link = kind is above and kind in (And, Or)  # its chain was shown already, at the first link
        above = kind
        if is_link or not isinstance(step.formula, And | Or | Implies | Iff):
            continue
        sides = links(step.formula) if isinstance(step.formula, And | Or) else step.formula.children
        sample = round(step.time / view.experiment.output_interval)
        words = (_part_text(view, side, over_time, sample) for side in sides)
        numbers = (signed(over_time[side].item(sample), 4) for side in sides)
        time = plain(step.time, fine_clock(view))
        yield f"{_SIDES[kind]} at t = {time} s: {'; '.join(words)}", f"{_SIDES[kind]} {', '.join(numbers)}"


def _part_text(view: View, part: Formula, over_time: Mapping[Formula, Array], sample: int) -> str:
    return f"{part} robustness {in_unit(signed(over_time[part].item(sample), 4), _scale(view, part))}"


def _scale(view: View, part: Formula) -> str:
    """Unit of a part's robustness; empty unless all its signals have the same unit."""
    units = {view.variable(name).unit for name in part.signals}
    return units.pop() if len(units) == 1 else ""


def _predicates(
    view: View, diagnosis: Diagnosis, trajectory: Trajectory, over_time: Mapping[Formula, Array]
) -> Iterator[str]:
    """When each predicate was false, among the times at which the requirement asks for it.

    Of the one that decided without being false all is told by then, and of those that compare nothing but a
    discrete signal whose changes are all listed.
    """
    clock = fine_clock(view)
    discrete = view.discrete(trajectory).items()
    in_full = {n for n, c in discrete if np.count_nonzero(np.diff(c)) <= courses.SHOWN_CHANGES}
    for predicate in view.requirement.formula.predicates:
        if len(predicate.signals) == 1 and in_full.issuperset(predicate.signals):
            continue
        asked = ~np.isnan(over_time[predicate])
        margin, times = over_time[predicate][asked], trajectory.times[asked]
        start, end = float(times[0]), float(times[-1])
        wrong = margin < 0
        near = int(np.abs(margin).argmin())
        nearest, closest = float(times[near]), f"{shown(abs(margin[near])):.5g}"
        if not wrong.any():
            if predicate == diagnosis.path[-1].formula and nearest == diagnosis.critical_time:
                continue
            found = f"always true, smallest margin {closest} at {plain(nearest, clock)} s"
        elif wrong.all():
            found = f"never true, closest at {plain(nearest, clock)} s, off by {closest}"
        else:
            found = _rarer(trajectory, over_time[predicate], clock)
        gaps = " where it counts" * (round((end - start) / trajectory.step) + 1 > len(times))
        yield f"{predicate}, from {plain(start, clock)} to {plain(end, clock)} s{gaps}: {found}"


def _rarer(trajectory: Trajectory, margin: Array, clock: int) -> str:
    """When a predicate was false, or when it was true, if that was for less time; NaN is neither."""
    word, rare = min(("false", margin < 0), ("true", margin >= 0), key=lambda one: int(one[1].sum()))
    step, stretch = trajectory.step, courses.longest_stretch(trajectory.times, rare)
    assert stretch is not None, "it was neither always true nor never"
    begin, end = (plain(time, clock) for time in stretch)
    if rare.sum() == 1:
        return f"{word} only at {begin} s"
    if round((stretch[1] - stretch[0]) / step) + 1 == rare.sum():
        return f"{word} only from {begin} to {end} s"
    return f"{word} for about {number(float(rare.sum()) * step)} s in total, longest from {begin} to {end} s"


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


def _drawn(
    view: View, name: str, inside: Trajectory, column: Array, steps: Sequence[float], most: int
) -> str:
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


def _close_up(
    view: View, evaluation: Evaluation, inside: Trajectory, deciding: Mapping[str, Array]
) -> Iterator[str]:
    """What the deciding predicate compares, more exactly around the critical time."""
    verdict = evaluation.verdict
    assert verdict is not None
    for name, column in deciding.items():
        near = close_up_times(view, inside.times, column, evaluation)
        part = column[near]
        if np.ptp(part) <= _AT_REST * abs(verdict.robustness):
            continue
        visible = 10.0 ** -_decimals(view, column, name, verdict.robustness)
        claimed = CLOSE_TOLERANCE * float(np.ptp(part))
        told = courses.course(
            inside.times[near],
            part,
            clock=fine_clock(view),
            # Less than is claimed if the margin would not be visible.
            tolerance=min(claimed, max(visible, _FINEST * float(np.ptp(part)))),
            claimed=claimed,
            slower_than=0.0,
            kept=(verdict.critical_time,),
            coarsest=_COARSEST,
        )
        yield f"{name} around t = {plain(verdict.critical_time, fine_clock(view))} s: {told}"


def close_up_times(view: View, times: Array, column: Array, evaluation: Evaluation) -> NDArray[np.bool_]:
    """Which times are told more exactly: a share of them around the critical time, or a few periods."""
    assert evaluation.verdict is not None
    critical = evaluation.verdict.critical_time
    reach = _CLOSE_SHARE / 2 * float(times[-1])
    swings = courses.oscillations(times, column, slower_than=_SLOWEST_OSCILLATION * float(times[-1]))
    around = [s for s in swings if s.start <= critical <= s.end]
    if around:
        reach = _CLOSE_PERIODS / 2 * around[0].periods[0]
    return np.asarray(np.abs(times - critical) <= max(reach, 4 * view.experiment.output_interval))


def _input_steps(view: View, evaluation: Evaluation) -> tuple[float, ...]:
    """Times at which inputs step, if they are few."""
    signals = (s.stepped(view.space.stop_time) for s in evaluation.candidate.signals.values())
    found = sorted({time for s in signals if s.interpolation == "constant" for time in s.switch_times})
    return tuple(found) if len(found) <= _MOST_STEPS else ()


def _deciding(view: View, verdict: Verdict, inside: Trajectory) -> dict[str, Array]:
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


def _decimals(view: View, column: Array, name: str, robustness: float) -> int:
    """Decimals of a signal: more for signals of the formula, whose margin must be visible."""
    return column_decimals(column, margin=abs(robustness) if _is_judged(view, name) else None)


def _is_judged(view: View, name: str) -> bool:
    """Whether the formula names a signal; what is compared and is no signal is a term of the formula."""
    return name in view.requirement.formula.signals or name not in view.info
