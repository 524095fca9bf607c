"""What is wrong with requirements before anything is searched: nothing moves them, or they cannot fail."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Literal

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.core.words import counted, ends, listed, readable
from falsifier.engines.layout import fixed_layout
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import evaluate
from falsifier.fmu import FmuModel
from falsifier.fmu.description.structure import read_structure
from falsifier.problem.loading import load_source, sources_of
from falsifier.problem.problem import Problem, alike
from falsifier.problem.source import ProblemSource, source_of
from falsifier.problem.unit_check import defined_units, unit_conflicts
from falsifier.search.vacuity import hidden_margin
from falsifier.stl import Formula
from falsifier.stl.expression import Name, Number
from falsifier.stl.formula import And, Bare, Or, Temporal, Until, Window
from falsifier.stl.implication import implies
from falsifier.stl.intervals import Interval, decided

LintKind = Literal[
    "invalid", "unmoved", "always", "never", "margin", "window", "units", "boolean", "duplicate", "implied"
]


@dataclass(frozen=True, slots=True)
class LintFinding:
    """One thing that is wrong with a requirement.

    Attributes:
        requirement: its name.
        kind: ``invalid`` (it cannot be loaded), ``unmoved`` (no input moves it), ``always`` or ``never``
            (it holds or fails for every trajectory in range), ``margin`` (its robustness cannot say how near
            or how clear a violation is), ``window`` (a window that does not matter), ``units``, ``boolean``
            (a number stands alone like a Boolean), ``duplicate`` or ``implied`` (by another requirement or
            part).
        part: the part of the formula; empty if it is about the whole requirement.
        text: what is wrong.
        advice: what to do.
    """

    requirement: str
    kind: LintKind
    part: str
    text: str
    advice: str


def lint(target: str | ProblemSource, *, simulations: int = 0) -> list[LintFinding]:
    """Return what is wrong with the requirements of a spec; empty if nothing was found.

    Args:
        target: a spec, one of its requirements or a bundled name; or a problem's source, which may name a
            profile.
        simulations: simulations of the measured check of whether inputs move the requirements' signals; 0:
            only what the FMU declares counts.

    Raises:
        SpecError: if the spec as a whole cannot be read.
        ModelError: if the FMU cannot be used.
    """
    findings: list[LintFinding] = []
    problems: list[Problem] = []
    stated = target if isinstance(target, ProblemSource) else source_of(target)
    for source in [stated] if stated.stl is not None else sources_of(stated):
        try:
            problems.append(load_source(source))
        except SpecError as error:
            if error.key is None or not error.key.startswith("requirements."):
                raise
            advice = "correct it; falsifier check says the same"
            findings.append(LintFinding(source.name, "invalid", "", str(error), advice))
    try:
        for problem in problems:
            findings += static_findings(problem)
        for group in alike(problems):
            findings += _repeated(group)
            findings += unmoved_findings(group, simulations)
    finally:
        for problem in problems:
            problem.model.close()
    return findings


def static_findings(problem: Problem) -> Iterator[LintFinding]:
    """Yield what is wrong with one requirement by itself, without a simulation."""
    name, formula = problem.name, problem.requirement.formula
    for part, holds in decided(formula, ranges_of(problem)):
        yield _decided(problem, part, holds=holds)
    yield from (unequal := list(_unequal(problem)))
    if not unequal and (hidden := hidden_margin(problem)):
        yield LintFinding(name, "margin", "", *hidden)
    yield from _windows(problem)
    for predicate, text in unit_conflicts(formula, problem.info, defined_units(problem.model)):
        yield LintFinding(name, "units", str(predicate), text, "give both sides the same unit")
    for part in formula.walk():
        if isinstance(part, Bare):
            text = f"{part.left} stands alone like a Boolean, but is a number, so it means {part}"
            yield LintFinding(name, "boolean", str(part.left), text, "write the comparison that is meant")
        if isinstance(part, And | Or):
            yield from _implied_side(name, part)


def ranges_of(problem: Problem) -> dict[str, Interval]:
    """Return the range of each signal: what is searched or fixed throughout, else what the model declares."""
    found = {}
    for v in problem.info.variables:
        low, high = v.limits
        found[v.name] = Interval(-np.inf if low is None else low, np.inf if high is None else high)
    found |= {name: Interval(value, value) for name, value in _constants(problem).items()}
    starts = problem.info.starts
    return found | {r.name: Interval(r.low, r.high) for r in problem.space.ranges if r.name not in starts}


def _constants(problem: Problem) -> dict[str, float]:
    """Return the values that stay the same: inputs and parameters that are not searched."""
    held = (h for h in problem.held if h.name not in problem.info.starts)
    return {h.name: h.value for h in held if isinstance(h.value, float | int)}


def _decided(problem: Problem, part: Formula, *, holds: bool) -> LintFinding:
    ranges = ranges_of(problem)
    bounds = [
        f"{n} = {readable(low)}" if low == high else f"{n} in [{', '.join(ends(low, high))}]"
        for n in part.signals
        for low, high in [(ranges[n].low, ranges[n].high)]
    ]
    because = f"as long as {listed(bounds)}" if bounds else "whatever happens"
    if part == problem.requirement.formula:
        what = "no trajectory in range violates it" if holds else "every trajectory in range violates it"
        advice = "check threshold, direction of the inequality and ranges; a search would be of no use"
    else:
        what = "this part always holds" if holds else "this part never holds"
        advice = "check its threshold and direction, or leave it out"
    return LintFinding(problem.name, "always" if holds else "never", str(part), f"{what}, {because}", advice)


def _unequal(problem: Problem) -> Iterator[LintFinding]:
    """Yield comparisons with a number in range that an integer, Boolean or enumeration never is."""
    ranges = ranges_of(problem)
    for part in dict.fromkeys(problem.requirement.formula.predicates):
        for one, other in permutations((part.left, part.right)):
            if (
                part.operator not in ("==", "!=")
                or not isinstance(one, Name)
                or not isinstance(other, Number)
            ):
                continue
            wrong = problem.info[one.name].expected(other.value)
            if wrong and ranges[one.name].low <= other.value <= ranges[one.name].high:
                kind: LintKind = "never" if part.operator == "==" else "always"
                text = f"this part {kind} holds: {wrong}"
                yield LintFinding(problem.name, kind, str(part), text, "write a number that it can be")


def _windows(problem: Problem) -> Iterator[LintFinding]:
    still = {*_constants(problem), *(p.name for p in problem.space.parameters)} - problem.info.starts
    for part in dict.fromkeys(problem.requirement.formula.walk()):
        if not isinstance(part, Temporal):
            continue
        if part.window == Window(0.0, 0.0) and not isinstance(part, Until):
            text, advice = "the window contains only the present", f"leave it out: {part.children[0]}"
        elif part.signals and set(part.signals) <= still:
            text = f"nothing changes {listed(part.signals)} over time, so the operator does not matter"
            advice = "leave the operator out, or name a signal that changes"
        else:
            continue
        yield LintFinding(problem.name, "window", str(part), text, advice)


def _implied_side(name: str, part: And | Or) -> Iterator[LintFinding]:
    """Yield the side of a conjunction or disjunction that does not matter, because the other implies it."""
    for one, other in permutations((part.left, part.right)):
        if not implies(one, other):
            continue
        spare, kept = (other, one) if isinstance(part, And) else (one, other)
        because = "implies it" if isinstance(part, And) else "it implies"
        is_window = type(spare) is type(kept) and isinstance(spare, Temporal)
        yield LintFinding(
            name,
            "window" if is_window and spare.children == kept.children else "implied",
            str(spare),
            f"it does not matter beside {kept}, which {because}",
            "leave it out, or correct its window or threshold",
        )
        return


def _repeated(group: Sequence[Problem]) -> Iterator[LintFinding]:
    """Yield requirements that say the same as another one of the same search, or less."""
    for (i, one), (j, other) in permutations(enumerate(group), 2):
        a, b = one.requirement.formula, other.requirement.formula
        if not implies(a, b):
            continue
        if not implies(b, a):
            yield LintFinding(
                other.name,
                "implied",
                "",
                f"{one.name} implies it: {a}",
                f"leave one of them out, or keep {other.name} to learn which part fails",
            )
        elif i < j:
            text = f"it requires the same as {one.name}: {a}"
            yield LintFinding(other.name, "duplicate", "", text, "leave one of them out")


def unmoved_findings(group: Sequence[Problem], simulations: int) -> Iterator[LintFinding]:
    """Yield requirements about signals on which nothing that is searched has an effect.

    What the FMU declares counts only if no simulation contradicts it. Without a declaration, signals that are
    continuous and the same in all simulations count. Without simulations, only what is declared counts. The
    problems of a group differ only in their requirement.
    """
    named = {p.name: set(p.requirement.formula.signals) for p in group}  # none: it is always decided
    suspects = [p for p in group if named[p.name] and not named[p.name] & set(p.space.names)]
    declared = {p.name: _is_declared_independent(p) for p in suspects}
    # A discrete signal may keep its value in all simulations and depend on inputs all the same.
    shown = {p.name: {v.name for v in p.info.variables if v.is_continuous} for p in suspects}
    asked = [p for p in suspects if declared[p.name] or shown[p.name] >= named[p.name]]
    simulated = _simulated(group[0], simulations) if asked and simulations else []
    for problem in asked:
        signals = problem.requirement.formula.signals
        courses = {tuple(t[name].tobytes() for name in signals) for t in simulated}
        if len(courses) > 1 or (not declared[problem.name] and len(simulated) < 2):
            continue
        measured = f"{counted(len(simulated), 'random simulation')} had the same {listed(signals)}"
        if declared[problem.name]:
            text = "declared: the FMU's structure has no path from a searched input to its signals"
            text += f"; measured: {measured}" if len(simulated) > 1 else ""
        else:
            text = f"measured: {measured}; the FMU does not declare whether inputs have an effect"
        advice = "search other inputs, or name a signal on which they have an effect"
        yield LintFinding(problem.name, "unmoved", "", text, advice)


def _is_declared_independent(problem: Problem) -> bool:
    """Whether the FMU says that no searched input reaches the requirement; it says nothing on parameters."""
    model = problem.model
    if not isinstance(model, FmuModel) or problem.space.parameters:
        return False
    known = read_structure(model.path, model.sha256).reaching
    searched = set(problem.space.names)
    signals = problem.requirement.formula.signals
    return all(name in known and not known[name] & searched for name in signals)


def _simulated(problem: Problem, simulations: int) -> list[Trajectory]:
    rng = np.random.default_rng(0)
    box = fixed_layout(problem.space)
    points = rng.random((simulations, box.dimension))
    drawn = (box.candidate(point, origin="", rationale="") for point in points)
    found = (evaluate(problem, candidate).trajectory for candidate in drawn)
    return [trajectory for trajectory in found if trajectory is not None]
