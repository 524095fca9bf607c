"""Everything observed in one sample: what broke or decided it, parts of the formula, signals over time."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import inf

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.core.words import counted, in_unit, listed
from falsifier.evaluation.evaluate import Evaluation, compiled
from falsifier.llm.prompts import courses
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.numbers import fine_clock, number, plain
from falsifier.llm.prompts.together import Side, asked_for, closest, longest_failure, near_misses
from falsifier.llm.prompts.told_courses import (
    FEWER_BREAKPOINTS,
    close_up,
    continuous,
    deciding_columns,
    decimals_of,
    drawn,
)
from falsifier.llm.prompts.view import View
from falsifier.stl import Diagnosis, Formula, Verdict
from falsifier.stl.diagnosis import VacuousImplication, links
from falsifier.stl.formula import And, Iff, Implies, Or
from falsifier.stl.margins import shown, signed

# Digits of robustness values: the search depends on small differences between samples.
ROBUSTNESS_DIGITS = 5
_SIDES: Mapping[type[Formula], str] = {
    And: "conjuncts",
    Or: "alternatives",
    Implies: "condition and consequence",
    Iff: "sides",
}
_MARGIN = re.compile(r" by [^ ]+$")


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
    told_parts = tuple(_parts(view, diagnosis, over_time, is_timed=is_timed))
    parts = tuple(text for text, _ in told_parts)
    line = line if is_timed else ""  # at no time more than at others
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
    deciding = deciding_columns(view, verdict, inside)
    over_all = (*continuous(view, evaluation, inside), *close_up(view, verdict, inside, deciding, failure))
    few_courses = (f"{n}: {drawn(view, n, inside, c, (), FEWER_BREAKPOINTS)}" for n, c in deciding.items())
    return Observed(
        (*reasons, *there, *parts, *discrete, *predicates, *over_all),
        (*reasons, *parts, *discrete, *predicates, *few_courses),
        "; ".join(filter(None, (line, *(brief for _, brief in told_parts[:1])))),
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
    yield " ".join((f"why: {decided}.", *_vacuous(diagnosis.vacuities)))


def _vacuous(found: Sequence[VacuousImplication]) -> Iterator[str]:
    """Which implications had a condition that was never true, each condition once."""
    alike: dict[object, list[VacuousImplication]] = {}
    for one in found:
        alike.setdefault((one.implication.left, one.window, one.only), []).append(one)
    for first, *others in alike.values():
        also = f" It is the condition of {counted(len(others), 'other implication')}, too." if others else ""
        yield f"{first.text}{also}"


def _discrete(view: View, inside: Trajectory) -> Iterator[str]:
    """Changes of all discrete signals, and stays of those in the formula."""
    for name, column in view.discrete(inside).items():
        clock, label = fine_clock(view), partial(view.labelled, name)
        yield f"{name}: {courses.change_list(inside.times, column, clock=clock, label=label)}"
        stays = courses.dwell_list(inside.times, column, clock=clock, label=label)
        if name in view.formula_outputs and stays:
            yield f"{name} stays: {stays}"


def _values_at(view: View, trajectory: Trajectory, time: float, robustness: float) -> str:
    there = []
    told = {*view.recorded, *(r.name for r in view.space.inputs), *(v.name for v in view.info.inputs)}
    for name, value in trajectory.at(time).items():
        if name not in told:  # a search may record more
            continue
        decimals = decimals_of(view, trajectory[name], name, robustness)
        told_value = view.labelled(name, value, plain(value, decimals))
        there.append(f"{name} = {in_unit(told_value, view.variable(name).unit)}")
    all_of_them = "all " * (not view.untold)
    return f"{all_of_them}signals at t = {plain(time, fine_clock(view))} s: {', '.join(there)}"


def _nearest(view: View, trajectory: Trajectory, over_time: Mapping[Formula, Array]) -> Iterator[str]:
    """How close the others came to what is needed while some did what must happen together."""
    clock = fine_clock(view)
    violation = Side(view.requirement.formula, must_hold=False)
    for met, missing, sample in near_misses(violation, trajectory.times, over_time):
        if all(_is_still(over_time[side.part]) for side in missing):
            continue  # it is never nearer
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


def _is_still(column: Array) -> bool:
    """Whether robustness is as far from 0 at all of several times, as that of a Boolean is."""
    asked = np.abs(column[~np.isnan(column)])
    return len(asked) > 1 and float(np.ptp(asked)) == 0


def _parts(
    view: View, diagnosis: Diagnosis, over_time: Mapping[Formula, Array], *, is_timed: bool
) -> Iterator[tuple[str, str]]:
    """Robustness of both sides of every connective on the path to what decided; the same in numbers alone.

    Not of an implication where what decided is the same at all times: at which of these it did is chance.
    """
    above: type[Formula] | None = None
    for step in diagnosis.path:
        kind = type(step.formula)
        is_link = kind is above and kind in (And, Or)  # its chain was shown already, at the first link
        above = kind
        if is_link or not isinstance(step.formula, And | Or | Implies | Iff):
            continue
        if not is_timed and isinstance(step.formula, Implies | Iff):
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
    total, first = number(float(rare.sum()) * step), float(trajectory.times[int(rare.argmax())])
    since = f"first at {plain(first, clock)} s, " * (first < stretch[0])
    return f"{word} for about {total} s in total, {since}longest from {begin} to {end} s"
