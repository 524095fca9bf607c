"""What a whole search did not test, collected simulation by simulation.

Parts of the requirement that never had a say, and inputs and parameters without an effect on it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import inf

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.model import ModelInfo
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import counted, listed, readable
from falsifier.evaluation.evaluate import Evaluation, monitor_for
from falsifier.problem.problem import Problem
from falsifier.search.findings import Finding, FindingKind
from falsifier.stl.expression import Arithmetic, Call, Expression, Name, Number
from falsifier.stl.formula import Formula, Implies, Next, Or, Predicate, Temporal
from falsifier.stl.intervals import without_equality
from falsifier.stl.margins import is_on_limit, shown, signed

# A predicate is far from its threshold if it stays away by this multiple of the range over which it moves.
_FAR = 3.0
# Number of simulations from which on a robustness that never changes means something.
_FEWEST = 2
# Maximum number of signals that are named.
_MOST_NAMED = 4


@dataclass(frozen=True, slots=True)
class _Extreme:
    """The smallest or largest margin of a part, when it had it, and the signals' values then."""

    margin: float
    simulation: int = 0
    time: float = 0.0
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(slots=True)
class _Seen:
    """What a search has seen of one part, wherever it stands in the same formula."""

    formula: Formula  # the implication or disjunction to which the part belongs; for a predicate itself
    part: Formula  # the condition of an implication, an operand of a disjunction, or a predicate
    lowest: _Extreme = _Extreme(inf)  # its smallest margin
    highest: _Extreme = _Extreme(-inf)  # its largest margin

    @property
    def distance(self) -> float:
        """Smallest distance to its threshold, if it kept one truth."""
        return max(self.lowest.margin, -self.highest.margin)

    @property
    def range(self) -> float:
        """By how much it moved."""
        return self.highest.margin - self.lowest.margin


class Vacuity:
    """Extremes of a requirement's parts over all simulations of a search."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._monitor = monitor_for(problem)
        seen: dict[tuple[Formula, Formula], _Seen] = {}
        # One for each place that is watched; places of the same part of the same formula share it.
        self._places = [
            seen.setdefault((formula, part.formula), _Seen(formula, part.formula))
            for formula, part in self._monitor.watched
        ]
        self._parts = list(seen.values())
        self._effects = Effects(problem)
        self._count = 0
        self._robustness: set[float] = set()
        self._first: dict[str, NDArray[np.float64]] = {}
        self._moved: set[str] = set()

    def see(self, evaluation: Evaluation, simulation: int) -> None:
        """Add a simulation; one without a verdict says nothing."""
        verdict, trajectory = evaluation.verdict, evaluation.trajectory
        if verdict is None or trajectory is None:
            return
        self._count += 1
        self._effects.see(evaluation.candidate, trajectory)
        if len(self._robustness) <= 1:
            self._robustness.add(verdict.robustness)
        for name in set(self._problem.requirement.formula.signals) - self._moved:
            first = self._first.setdefault(name, trajectory[name])
            if not np.array_equal(first, trajectory[name]):
                self._moved.add(name)
        for seen, found in zip(self._places, self._monitor.extremes(trajectory), strict=True):
            if found.low < seen.lowest.margin:
                seen.lowest = _Extreme(found.low, simulation, found.lowest, trajectory.at(found.lowest))
            if found.high > seen.highest.margin:
                seen.highest = _Extreme(found.high, simulation, found.highest, trajectory.at(found.highest))

    def findings(self, *, is_all: bool) -> tuple[Finding, ...]:
        """Return what was not tested by any simulation so far; the most important first.

        ``is_all`` says that the whole search space was simulated, so that no more simulations can help.
        """
        if not self._count:
            return ()
        constant = tuple(self._constant(is_all=is_all))
        never = [p for p in self._parts if isinstance(p.formula, Implies) and p.highest.margin < 0]
        always = [p for p in self._parts if isinstance(p.formula, Or) and p.lowest.margin > 0]
        said = {predicate for part in never for predicate in part.part.predicates}
        # A requirement whose signals do not move at all has no predicate that could be nearer.
        moving = [part for part in self._parts if part.formula.signals and not constant]
        predicates = [part for part in moving if isinstance(part.formula, Predicate)]
        # Those that kept one truth, by much more than they moved.
        kept = [part for part in predicates if part.distance > _FAR * part.range]
        far = [part for part in kept if not is_on_limit(part.distance) and part.formula not in said]
        found = (*map(self._condition, never), *map(self._disjunct, always), *map(self._far, far))
        unique = {(finding.kind, finding.part): finding for finding in found}
        # If nothing moves the requirement's signals, that has been said of everything that was searched.
        idle = self._effects.findings() if self._moved else ()
        if hidden := hidden_margin(self._problem):
            what, advice = hidden
            constant += (Finding(kind="margin", text=f"{what[0].upper()}{what[1:]}; {advice}."),)
        return (*constant, *unique.values(), *idle)

    @property
    def _in_all(self) -> str:
        return f"in {counted(self._count, 'simulation')}" if self._count > 1 else "in the only simulation"

    def _constant(self, *, is_all: bool) -> Iterator[Finding]:
        """Tell that the robustness never changed, unless steps of whole numbers explain that."""
        info, signals = self._problem.info, self._problem.requirement.formula.signals
        if self._count < _FEWEST or len(self._robustness) > 1 or not signals:
            return
        value = next(iter(self._robustness))
        if not self._moved:
            text = (
                f"Nothing that was searched had an effect on {listed(signals)}: the same {self._in_all}, "
                f"with robustness {signed(value)}. Search {'' if is_all else 'longer, or search '}"
                f"inputs and parameters on which {'it depends' if len(signals) == 1 else 'they depend'}."
            )
        elif all(name in info and info[name].kind == "real" for name in signals):
            text = (
                f"The robustness was {signed(value)} {self._in_all}, although "
                f"{listed(sorted(self._moved))} changed: the value that decides it was the same each "
                f"time. {'Vary more' if is_all else 'Search longer, or vary more'}."
            )
        else:
            return
        yield Finding(kind="constant", text=text, part=str(self._problem.requirement.formula), margin=value)

    def _condition(self, seen: _Seen) -> Finding:
        what = (
            f"The condition {seen.part} never held {self._in_all}, so {seen.formula} was not tested. It must "
            "hold at some time"
        )
        return _untested("condition", seen, seen.highest, what, "it was false")

    def _disjunct(self, seen: _Seen) -> Finding:
        what = (
            f"{seen.part} always held {self._in_all}, so the other side of {seen.formula} was not tested. It "
            "must fail at some time"
        )
        return _untested("disjunct", seen, seen.lowest, what, "it held")

    def _far(self, seen: _Seen) -> Finding:
        what = (
            f"{seen.formula} was never near its threshold {self._in_all}: it moved by "
            f"{seen.range:.6g} and stayed {seen.distance:.6g} away"
        )
        closest = seen.lowest if seen.lowest.margin > 0 else seen.highest
        return _untested("threshold", seen, closest, what, "it was off")


def _untested(kind: FindingKind, seen: _Seen, best: _Extreme, what: str, off: str) -> Finding:
    """Return the finding about a part: what was not tested, and how close the part came to changing.

    ``off`` says how the margin is told if its values are not telling.
    """
    margin = abs(best.margin)
    near = _reached(seen.part, best.values) or f"{off} by {shown(margin):.6g}"
    return Finding(
        kind=kind,
        text=f"{what}; at the closest, {near} (simulation {best.simulation + 1}, {readable(best.time)} s).",
        part=str(seen.part),
        margin=margin,
        time=best.time,
        simulation=best.simulation + 1,
    )


def _reached(formula: Formula, values: Mapping[str, float]) -> str:
    """Return what the sides of a part's predicates were; empty if the part looks at other times too."""
    if any(isinstance(part, Temporal | Next) for part in formula.walk()):
        return ""
    sides = dict.fromkeys(s for p in formula.predicates for s in p.sides if not isinstance(s, Number))
    if not sides or not all(name in values for side in sides for name in side.signals):
        return ""
    return listed([f"{side} reached {readable(float(side.evaluate(values)))}" for side in sides])


def _is_whole(part: Expression, info: ModelInfo) -> bool:
    """Whether a part of an expression keeps whole numbers whole."""
    match part:
        case Name(name):
            return info.kind(name) != "real"
        case Number(value):
            return value.is_integer()
        case Arithmetic(operator):
            return operator in ("+", "-", "*")
        case Call(function):
            return function in ("abs", "min", "max")
    return True


def hidden_margin(problem: Problem) -> tuple[str, str] | None:
    """Return why Booleans, or ==, leave the robustness without a margin, and what to do; None if not."""
    formula, info = problem.requirement.formula, problem.info
    if tolerant := without_equality(formula):
        what = (
            "the requirement can be violated only exactly on its limit, with robustness -0, however clear "
            "the violation is, because == and != have no margin where both sides are equal"
        )
        equal = [side for p in formula.predicates if p.operator in ("==", "!=") for side in p.sides]
        if not all(_is_whole(part, info) for side in equal for part in side.walk()):
            return what, "compare with a tolerance: for x == 3 write abs(x - 3) <= 0.5"
        if any(info.kind(name) == "real" for name in formula.signals):  # among whole numbers, all is as clear
            return what, f"write {tolerant}"
    signals = formula.signals
    if not signals or any(info.kind(name) != "boolean" for name in signals):
        return None
    names_are = f"{listed(signals)} {'is' if len(signals) == 1 else 'are'}"
    numbers = [v.name for v in info.observables if v.kind == "real"][:_MOST_NAMED]
    known = f"the model has {listed(numbers)}" if numbers else "make them outputs of the model"
    return (
        f"the robustness has few values, because {names_are} Boolean: none says how near a violation is",
        f"compare the numbers of which {names_are} made instead ({known})",
    )


class Effects:
    """Compares simulations that differ in one input or parameter alone.

    Others say nothing for certain: what one input changes, another may change back.
    """

    def __init__(self, problem: Problem) -> None:
        self._names = problem.space.names
        # An input that the formula names has an effect on it, whatever the system does.
        signals = problem.requirement.formula.signals
        self._signals = [s for s in signals if s not in self._names or s in problem.info.starts]
        self._judged = [name for name in self._names if name not in problem.requirement.formula.signals]
        # Each signal and value gets a number: Python's hashes of -1 and -2 are the same.
        self._numbers: dict[object, int] = {}
        # By name and the hash of everything else: what was simulated, and what came of it.
        self._seen: dict[tuple[str, int], tuple[set[int], set[int]]] = {}

    def see(self, candidate: Candidate, trajectory: Trajectory) -> None:
        """Add a simulation."""
        varied, known = {**candidate.signals, **candidate.parameters}, self._numbers
        parts = {name: known.setdefault(varied[name], len(known)) for name in self._names}
        outcome = hash(tuple(trajectory[name].tobytes() for name in self._signals))
        for name in self._judged:
            rest = hash(tuple((other, part) for other, part in parts.items() if other != name))
            values, outcomes = self._seen.setdefault((name, rest), (set(), set()))
            values.add(parts[name])
            outcomes.add(outcome)

    def findings(self) -> Iterator[Finding]:
        """Yield what never had an effect although simulations differ in it alone."""
        if not self._signals:
            return
        for name in self._judged:
            alone = [seen for (of, _), seen in self._seen.items() if of == name and len(seen[0]) > 1]
            if alone and all(len(outcomes) == 1 for _, outcomes in alone):
                count = sum(len(values) for values, _ in alone)
                yield Finding(
                    kind="effect",
                    text=(
                        f"{name} had no effect on {listed(self._signals)}: the same in "
                        f"{counted(count, 'simulation')} that differ in it alone."
                    ),
                    part=name,
                )
