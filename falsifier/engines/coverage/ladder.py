"""The way down where robustness has few values: what reached a step the soonest is continued differently.

Time is what is short there: nothing can follow an input that reaches the last step at the end, and one that
made the first step soon may make all of them.
"""

from collections import defaultdict
from collections.abc import Mapping
from math import inf
from typing import Any

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.engines.box import Proposal
from falsifier.engines.coverage.programs import KeptInput, Programs
from falsifier.engines.layout import Array, learnable
from falsifier.problem.problem import Problem
from falsifier.stl import Verdict
from falsifier.stl.formula import Predicate

# Probabilities of the same done again, of that with something else tried each time, and of a new end from an
# earlier time; else one from then.
_AGAIN, _TRIED, _EARLIER = 0.6, 0.15, 0.1
# Of what is done again, the share without a stretch before it, and that with all that led there; the shortest
# span otherwise, as a share of the time until then.
_SOONER, _FROM_START, _SHORTEST = 0.5, 0.3, 0.05
# Mean rank, from 0, of the step that is gone on from, the lowest first.
_MEAN_RANK = 1.0
# Two values of robustness that differ by at most this share of their size are the same.
_SAME = 1e-6
# A predicate that has more different margins than this in one trajectory, or in all, has no steps.
_MOST_STEPS, _MOST_IN_ALL = 32, 1000


class Ladder:
    """Proposes how to get further down, with programs of the inputs."""

    def __init__(self, problem: Problem, programs: Programs) -> None:
        driven = {r.name for r in problem.space.inputs}
        predicates = problem.requirement.formula.predicates
        self._predicates = {str(p): p for p in predicates if driven.isdisjoint(p.signals)}
        self._programs = programs
        self._duration = problem.experiment.stop_time
        self._lowest = inf
        self._at_lowest: list[KeptInput] = []
        # For each predicate and each of its margins, the input that had that margin the soonest.
        self._soonest: defaultdict[str, dict[float, KeptInput]] = defaultdict(dict)
        # The predicate that decided the lowest robustness, and 1, or -1 if it counts negated.
        self._decider: tuple[str, float] | None = None

    def learn(self, point: Array, trajectory: Trajectory, verdict: Verdict) -> None:
        """Add a simulation."""
        robustness = float(learnable(verdict.robustness))
        difference = robustness - self._lowest
        if difference < -_SAME * abs(robustness):
            self._lowest, self._at_lowest = robustness, []
        for name, predicate in self._predicates.items():
            soonest = self._soonest[name]
            if len(soonest) > _MOST_IN_ALL:
                continue
            margins = np.broadcast_to(_margin(predicate, trajectory.columns), len(trajectory))
            steps, samples = np.unique(margins, return_index=True)
            if len(steps) > _MOST_STEPS or np.isnan(margins).any():
                continue
            for step, time in zip(steps.tolist(), trajectory.times[samples].tolist(), strict=True):
                if step not in soonest or time < soonest[step].time:
                    soonest[step] = KeptInput(point, time)
        if difference <= _SAME * abs(robustness):
            self._at_lowest.append(KeptInput(point, verdict.critical_time))
            self._decider = self._deciding(verdict)

    def propose(self, rng: np.random.Generator) -> Proposal:
        """Return an input that reached a low step, continued differently after that."""
        programs = self._programs
        what, reached = self._base(rng)
        reached.tries += 1
        where = f"the input that made {what} at {reached.time:.3g} s"
        kind = rng.random()
        if kind < _AGAIN:
            return Proposal(self._again(rng, reached), f"{where}, done again and again")
        if kind < _AGAIN + _TRIED:
            point = programs.tried_again(rng, reached.point, reached.time, _span(rng, reached.time))
            return Proposal(point, f"{where}, and something else tried after each time that it is done again")
        # Now and then from an earlier time: it may have been too late.
        time = reached.time * (rng.random() if kind < _AGAIN + _TRIED + _EARLIER else 1.0)
        return Proposal(programs.another_end(rng, reached.point, time), f"{where}, continued differently")

    def _deciding(self, verdict: Verdict) -> tuple[str, float] | None:
        predicate = self._predicates.get(verdict.predicate)
        if predicate is None or not verdict.values:
            return None
        is_negated = bool(_margin(predicate, verdict.values) > 0) != (verdict.robustness > 0)
        return verdict.predicate, -1.0 if is_negated else 1.0

    def _base(self, rng: np.random.Generator) -> tuple[str, KeptInput]:
        """Return what was reached, in words, and by which input.

        The later the lowest robustness was reached, the more often it is what reached a step the soonest.
        """
        share = min(r.time for r in self._at_lowest) / self._duration
        steps = self._steps() if rng.random() < share else []
        if not steps:
            lowest = min(self._at_lowest, key=lambda r: (r.tries, r.time))
            return f"the robustness {self._lowest:.4g}", lowest
        margin, reached = steps[min(int(rng.exponential(_MEAN_RANK)), len(steps) - 1)]
        return f"a margin of {margin:.4g}", reached

    def _steps(self) -> list[tuple[float, KeptInput]]:
        """Return the margins of the predicate that decides, without the highest, the lowest first."""
        name, sign = self._decider or ("", 1.0)
        if name not in self._soonest or len(self._soonest[name]) > _MOST_IN_ALL:
            return []
        steps = sorted((sign * margin, reached) for margin, reached in self._soonest[name].items())
        return [(s, reached) for s, reached in steps[:-1] if s >= self._lowest - _SAME * abs(s)]

    def _again(self, rng: np.random.Generator, reached: KeptInput) -> Array:
        """Return the input that goes on with what it did before that until the end."""
        point, time = reached.point, reached.time
        if rng.random() < _SOONER:
            point, time = self._programs.sooner(rng, point, time)
        return self._programs.again(rng, point, time, _span(rng, time))


def _span(rng: np.random.Generator, time: float) -> float:
    """Draw how much in s of what was done before a time is done again."""
    return time if rng.random() < _FROM_START else time * float(np.exp(rng.uniform(np.log(_SHORTEST), 0.0)))


def _margin(predicate: Predicate, columns: Mapping[str, Any]) -> Array:
    return predicate.margin({name: learnable(columns[name]) for name in predicate.signals})
