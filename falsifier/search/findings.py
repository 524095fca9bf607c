"""What a search could not show, so that its answer is not taken for more than it says."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from falsifier.core.literals import toml_key
from falsifier.core.ranges import InputRange
from falsifier.core.space import SearchSpace
from falsifier.core.words import counted, ends
from falsifier.engines import DEFAULT_ENGINE
from falsifier.errors import written
from falsifier.problem.grid import default_freedom, smallest_window
from falsifier.problem.problem import Problem
from falsifier.problem.sections import FreeSection
from falsifier.problem.source import Parameterization
from falsifier.search.parameterization import searched_space

# A number that is not part of a name: two errors that differ only in such numbers have the same cause.
_NUMBER = re.compile(r"(?<!\w)[-+]?(?:0x[0-9a-f]+|\d+(?:\.\d*)?(?:e[-+]?\d+)?)", re.IGNORECASE)

# parameterization: only fixed control points were searched; condition: that of an implication never held;
# disjunct: one side of an ``or`` always held; threshold: a predicate was never near its threshold;
# constant: the robustness was the same in all simulations; effect: an input or parameter had none;
# margin: the robustness cannot say how near a violation is.
FindingKind = Literal[
    "parameterization", "condition", "disjunct", "threshold", "constant", "effect", "margin"
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that a search could not show.

    Attributes:
        kind: what it is about.
        text: what it is, and what would have to happen, in words.
        part: the part of the formula, or the input or parameter, that it is about; empty if it is about none.
        margin: how far the part was from changing its truth; None if that has no meaning.
        time: when it came closest, in s; None if that has no meaning.
        simulation: number, from 1, of the simulation in which it came closest; None if that has no meaning.
    """

    kind: FindingKind
    text: str
    part: str = ""
    margin: float | None = None
    time: float | None = None
    simulation: int | None = None

    @property
    def untested(self) -> bool:
        """Whether a part of the requirement never had a say, or nothing moved it; not: a wide margin."""
        return self.kind in ("condition", "disjunct", "constant")


@dataclass(frozen=True, slots=True)
class Failure:
    """Simulations that failed for the same cause: how many, and reason and number, from 1, of the first."""

    count: int
    reason: str
    simulation: int

    @property
    def text(self) -> str:
        """The cause, with an example."""
        which = f"simulation {self.simulation}"
        if self.count == 1:
            return f"{which} failed: {self.reason}"
        return f"{self.count} simulations failed, for example {which}: {self.reason}"


def cause_of(reason: str) -> str:
    """Return a reason without its numbers: the same for failures of one cause."""
    return _NUMBER.sub("#", reason)


def failures(reasons: Iterable[tuple[int, str]]) -> tuple[Failure, ...]:
    """Group failed simulations, given by index and reason, by their cause; the most frequent first.

    >>> [f.text for f in failures([(3, "index 0 is outside of 1..5"), (7, "index 9 is outside of 1..5")])]
    ['2 simulations failed, for example simulation 4: index 0 is outside of 1..5']
    """
    found: dict[str, Failure] = {}
    for index, reason in reasons:
        cause = cause_of(reason)
        known = found.get(cause, Failure(0, reason, index + 1))
        found[cause] = Failure(known.count + 1, known.reason, known.simulation)
    return tuple(sorted(found.values(), key=lambda failure: -failure.count))


def inexpressible(problem: Problem, used: Parameterization) -> Finding | None:
    """Return what the fixed control points of a search could not express; None if they left nothing out.

    ``used`` is ``fixed`` if the engine never chooses control points.
    """
    formula, searched = problem.requirement.formula, searched_space(problem.space, used)
    experiment = problem.experiment
    limits = default_freedom([formula], stop_time=experiment.stop_time, step=experiment.output_interval)
    coarse = [r for r in searched.inputs if r.free is None and r.control_points < limits.max_control_points]
    if not coarse:
        return None
    slow = "; ".join(_fastest(r, searched) for r in coarse)
    window = smallest_window([formula])
    against = "" if window is None else f". The formula's smallest window is {window:g} s"
    engine = written(f"--engine {DEFAULT_ENGINE}", f"engine={DEFAULT_ENGINE!r}")
    remedy = _way(problem, [r.name for r in coarse], limits)
    if used == "fixed":
        remedy = f"{engine} with {remedy}" if remedy else f"{engine}, which chooses control points itself"
    return Finding(
        kind="parameterization", text=f"Faster inputs were not tried: {slow}{against}. To try them: {remedy}."
    )


def _fastest(r: InputRange, space: SearchSpace) -> str:
    if r.control_points == 1:
        return f"{r.name} was constant"
    times = space.fixed_times(r)
    piece = times[1] - times[0]
    if r.interpolation == "constant":
        return f"{r.name} had {counted(r.control_points, 'held piece')} of {piece:.4g} s"
    return (
        f"{r.name} had {counted(r.control_points, 'control point')} ({r.interpolation}) and needed "
        f"{piece:.4g} s from {' to '.join(ends(r.low, r.high))}"
    )


def _way(problem: Problem, coarse: Sequence[str], limits: FreeSection) -> str:
    """Say what makes inputs free; empty if all of them are, and the engine alone does not use it."""
    source, count, shortest = problem.source, limits.max_control_points, limits.min_interval
    if all(r.free for r in problem.space.inputs if r.name in coarse):
        return ""
    if source is None:
        return f"InputRange(..., free=Freedom({count}, {shortest:g}))"
    option = written(f"--parameterization free:{shortest:g}", f"shortest_piece={shortest:g}")
    if source.parameterization != "fixed" and source.parts.kind == "spec":
        places = " and ".join(f"[inputs.{toml_key(name)}]" for name in coarse)
        option += f", or free = {{ max_control_points = {count}, min_interval = {shortest:g} }} in {places}"
    return option
