"""The coverage engine, and its archive of what was reached: return to it, then go on differently.

Returning before exploring is the idea of Go-Explore (Ecoffet et al., Nature 590 (2021) 580-586). Preferring
what is rare is the power schedule of coverage-guided fuzzers (Böhme et al., IEEE TSE 45 (2019) 489-506).
Values at which something happened are used again, as these fuzzers do with a dictionary.
Systems are causal: inputs that stay the same up to a time do what they did until then.
"""

from collections import Counter, defaultdict
from collections.abc import Sequence
from math import sqrt

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.trajectory import Trajectory
from falsifier.engines.box import Proposal
from falsifier.engines.coverage.marks import MODES, Mark, Marker
from falsifier.engines.coverage.programs import KeptInput, Programs
from falsifier.engines.layout import Array, Layout, TimeGrid, planning_layout
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem

# Probability that what follows a mark is a span of the same or another program; else it is a new end.
_REPEATED = 0.25
# Proposals, then random points, among which one that was not simulated is looked for.
_IDEAS, _DRAWS = 10, 100


class Explorer:
    """Proposes inputs that reach something that no simulation so far has reached.

    If it ``repeats``, spans of other inputs follow what was reached.
    """

    def __init__(self, problem: Problem, layout: Layout, *, repeats: bool) -> None:
        self._repeated = _REPEATED if repeats else 0.0
        self._marker = Marker(problem)
        self.programs = Programs(layout)
        self._interval = problem.experiment.output_interval
        levels: dict[str, list[float]] = defaultdict(list)
        searched = problem.space.names
        for level in (found for found in problem.context.crossings if found.signal in searched):
            levels[level.signal].append(level.value)
        self._aimed = Programs(layout, levels)
        # Whether levels are known at which something changes.
        self.has_levels = bool(levels)
        self._reached: dict[Mark, KeptInput] = {}
        self._by_source: dict[str, list[Mark]] = defaultdict(list)
        self._hits: Counter[Mark] = Counter()
        self._new: Counter[str] = Counter()
        self._seen = 0

    def learn(self, point: Array, trajectory: Trajectory) -> bool:
        """Add a simulation to the archive; return whether a discrete signal did something new."""
        self._seen += 1
        marks = self._marker.marks(trajectory)
        new = [mark for mark in marks if mark not in self._reached]
        self._new.update({mark.source for mark in new})
        for mark, time in marks.items():
            self._hits[mark] += 1
            known = self._reached.get(mark)
            if known is None:
                self._by_source[mark.source].append(mark)
            if known is None and mark.what[0] == "changes" and mark.source in self._marker.kinds:
                self.programs.remember(point, time, self._interval)
            if known is None or time < 0.95 * known.time:
                self._reached[mark] = KeptInput(point, time, known.tries if known else 0)
        events, sources = ("is", "changes", "after"), self._marker.kinds
        return any(m.source == MODES or (m.source in sources and m.what[0] in events) for m in new)

    def propose(self, rng: np.random.Generator, *, aimed: bool = False) -> Proposal:
        """Return the next input: one that reached a rare mark, continued differently after it.

        ``aimed``: new values are drawn between the levels at which something changes.
        """
        programs = self._aimed if aimed else self.programs
        if not programs.has_inputs:
            return Proposal(programs.fresh(rng), "random parameters: without inputs, nothing can be kept")
        mark = self._choose(rng)
        if mark is None:
            return Proposal(programs.fresh(rng), "a random program of the inputs: nothing was reached yet")
        reached = self._reached[mark]
        reached.tries += 1
        where = f"the input that made {describe(mark)} at {reached.time:.3g} s"
        if rng.random() < self._repeated:
            other = self._choose(rng) or mark
            source = self._reached[other]
            span = (float(rng.uniform(0.0, source.time)), source.time)
            point = programs.repeated(rng, reached.point, reached.time, source.point, span)
            return Proposal(point, f"{where}, followed by what made {describe(other)}")
        point = programs.another_end(rng, reached.point, reached.time)
        return Proposal(point, f"{where}, continued differently")

    def _choose(self, rng: np.random.Generator) -> Mark | None:
        """Draw a signal, then one of its marks; rare ones from which little was tried are more likely."""
        if not self._by_source:
            return None
        sources = list(self._by_source)
        # A signal that does something new every time distinguishes as little as one that never does.
        weights = np.array([1.05 - self._new[s] / self._seen for s in sources])
        # The modes count as much as all signals together: they are the states of what the system does.
        weights[[s == MODES for s in sources]] *= len(sources)
        source = sources[int(rng.choice(len(sources), p=weights / weights.sum()))]
        marks = self._by_source[source]
        rarity = np.array([1.0 / sqrt(self._hits[m] * (1 + self._reached[m].tries)) for m in marks])
        return marks[int(rng.choice(len(marks), p=rarity / rarity.sum()))]


def describe(mark: Mark) -> str:
    """Return a mark in words, as the object of "made"."""
    source, what = mark
    if source == MODES:
        return " and ".join(map(str, what))
    match what:
        case ("is", value):
            return f"{source} = {value:g}"
        case ("changes", old, new, count):
            return f"{source} change from {old:g} to {new:g}{f' {count} times' if count != 1 else ''}"
        case ("after", old, new, before, earlier, later, _):
            return f"{source} change from {old:g} to {new:g} after {before} from {earlier:g} to {later:g}"
        case ("near", _):
            return f"{source} come close to its threshold"
        case _:
            return f"{source} go {what[0]}"


class CoverageEngine:
    """Collects inputs that reached something new, and goes on from these; robustness is not used."""

    name = "coverage"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        self.layout = planning_layout(problem.space, TimeGrid.of(problem))
        self.seed = seed
        self._explorer = Explorer(problem, self.layout, repeats=True)
        self._known: set[object] = set()  # what was simulated or is about to be
        self._asked = 0

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n candidates."""
        return [self._ask_one() for _ in range(max(n, 1))]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Add the trajectories to what was reached."""
        for evaluation in evaluations:
            self._known.add(evaluation.candidate.key)
            if evaluation.trajectory is not None:
                self._explorer.learn(self.layout.point(evaluation.candidate), evaluation.trajectory)

    def _ask_one(self) -> Candidate:
        rng = np.random.default_rng([self.seed, self._asked])
        self._asked += 1
        for turn in range(_IDEAS + _DRAWS):
            if turn < _IDEAS:
                idea = self._explorer.propose(rng)
            else:
                point = self.layout.settled(rng.random(self.layout.dimension))
                idea = Proposal(point, "random: all other ideas were simulated")
            candidate = self.layout.candidate(idea.point, origin=self.name, rationale=idea.rationale)
            if candidate.key not in self._known:
                break
        self._known.add(candidate.key)
        return candidate
