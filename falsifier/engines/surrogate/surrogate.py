"""The surrogate engine: learn the dynamics, plan on them, simulate, refit."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from math import inf

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.engines.box import Array
from falsifier.engines.corner_walk import CornerWalk, Levels
from falsifier.engines.coverage import Explorer
from falsifier.engines.grid import Grid
from falsifier.engines.layout import Layout, planning_layout
from falsifier.engines.surrogate.aims import Aims
from falsifier.engines.surrogate.arms import choose_arm, flatness, has_lead, quality
from falsifier.engines.surrogate.coarse import coarse_formula, inner_windows
from falsifier.engines.surrogate.direct import Seen, propose
from falsifier.engines.surrogate.feasibility import Feasibility
from falsifier.engines.surrogate.forecast import Ensemble, Forecast
from falsifier.engines.surrogate.history import History, Sample, scaled_costs
from falsifier.engines.surrogate.opening import opening
from falsifier.engines.surrogate.planning import is_seen, plan
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.variation import random_points, stepping, switching
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.stl import Verdict

# Random points among which one that was not simulated is looked for, where all other ideas were.
_DRAWS = 100


@dataclass(frozen=True, slots=True, eq=False)
class Pending:
    """What the engine remembers about a candidate until it is told its evaluation.

    Attributes:
        arm: the engine's arm that proposed it.
        point: its point in the layout, in [0, 1]^d.
        why: rationale of the candidate.
        levels: its levels, for a constant extreme.
        forecast: predictions of the dynamics, if they proposed it.
    """

    arm: str
    point: Array
    why: str
    levels: Levels | None = None
    forecast: Forecast | None = None


class Surrogate:
    """Learns the dynamics from whole trajectories and proposes inputs with a low predicted robustness.

    In addition it searches directly, by changes of the best inputs; the arm that does better gets more turns.
    Where most simulations have the same robustness, what they covered leads the search.
    """

    name = "surrogate"

    def __init__(self, problem: Problem, *, seed: int, settings: Settings | None = None) -> None:
        self.problem, self.seed, self.settings = problem, seed, settings or Settings()
        space, formula = problem.space, problem.requirement.formula
        interval = problem.experiment.output_interval
        self.grid = Grid.over(
            formula.horizon(interval), space.stop_time, cells=self.settings.cells, shortest=interval
        )
        self.layout = planning_layout(space, self.grid)
        self.history = History(problem, self.grid, self.layout, self.settings)
        self.feasibility = Feasibility(self.grid)
        self._explorer = Explorer(problem, self.layout)
        self._aims = Aims(self.settings)
        self._lowest = inf
        self.dynamics = Ensemble(self.settings)
        windows = [w for w in inner_windows(formula) if w >= self.grid.step] if space.inputs else []
        self._windows = windows
        self._opening = opening(
            self.settings,
            has_inputs=bool(space.inputs),
            windows=windows,
            needs_several=coarse_formula(formula, self.grid.step).root.needs_several,
        )
        self._walk = CornerWalk(len(self.layout.groups))
        self._asked = self._planned = self._simple = 0
        self._pending: dict[object, Pending] = {}
        self._suggested: list[Array] = []
        self._failed: list[Array] = []
        self._stood_for: list[tuple[Array, float]] = []

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n candidates, each from the arm that is chosen for it."""
        return [self._ask_one() for _ in range(max(n, 1))]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Add the evaluations to the history; those of its own candidates also rate arms and forecasts."""
        for evaluation in evaluations:
            told = self.problem.space.admit(evaluation.candidate)
            pending = self._pending.pop(told.key, None)
            sample = self.history.add(evaluation, pending.arm if pending else "")
            point = self.layout.point(told)
            self.feasibility.add(self.layout, point, failed=sample is None)
            is_new = sample is not None and sample.robustness < self._lowest
            if evaluation.trajectory is not None:
                is_new |= self._explorer.learn(point, evaluation.trajectory)
            self._aims.learn(aimed=pending is not None and pending.arm == "levels", is_new=is_new)
            self._lowest = min(self._lowest, sample.robustness if sample is not None else inf)
            if sample is None:
                self._failed.append(point)
            if pending is not None:
                self._settle(pending, sample)
            elif sample is not None:
                self._hear(point, sample)

    def foresee(self, candidates: Sequence[Candidate]) -> list[Verdict]:
        """Return the verdicts that the better dynamics predict for candidates, without simulating them.

        The robustness is in the requirement's own unit. The list is empty until two simulations are known.
        It changes nothing: what is asked next is the same without it.
        """
        if len(self.history.samples) < 2 or not candidates:
            return []
        rng = np.random.default_rng([self.seed, self._asked, len(self.history.samples)])
        # A copy learns: an automaton from these samples, and trust in it, would change what is asked next.
        other = copy(self)
        other.dynamics, other.history = self.dynamics.copy(), self.history.copy()
        other._fit(rng)
        points = np.array([self.layout.point(c) for c in candidates])
        return other.dynamics.verdicts(self.layout, other.history.scaled_objective(), points)

    @property
    def recent_error(self) -> float:
        """Error of recent predictions, as a share of the margins' spread; inf if there are none."""
        return self.dynamics.recent_error

    def suggest(self, candidates: Sequence[Candidate]) -> None:
        """Add candidates to those from which the next plan is bred."""
        self._suggested = [self.layout.point(c) for c in candidates]

    @property
    def is_trusted(self) -> bool:
        """Whether recent predictions were good."""
        return self.dynamics.is_trusted

    @property
    def misses(self) -> int:
        """Number of planned inputs, counted back from the last one, that did not violate as predicted."""
        return self.dynamics.misses

    def _settle(self, pending: Pending, sample: Sample | None) -> None:
        """Learn from the evaluation of one of the engine's own candidates."""
        if pending.levels is not None:
            self._walk.learn(pending.levels, None if sample is None else sample.robustness)
        if pending.forecast is not None and sample is not None:
            objective = self.history.scaled_objective()
            self.dynamics.judge(pending.forecast, sample.values, objective, violated=sample.robustness < 0)
            if self.dynamics.is_surprised:
                self.history.learner.doubt()

    def _hear(self, point: Array, sample: Sample) -> None:
        """Learn from another engine's candidate; near a constant extreme, that one need not be simulated."""
        levels = self.layout.nearest_extreme(point, within=self.settings.near_extreme)
        if levels is not None:
            self._walk.heard(levels, sample.robustness)
            self._stood_for.append((self.layout.constant(levels), sample.robustness))

    def _ask_one(self) -> Candidate:
        rng = np.random.default_rng([self.seed, self._asked])
        pending = self._propose(rng)
        for _ in range(self.settings.retries):
            if self._objection(pending) == 0.0:
                break
            pending = min(pending, self._propose(rng), key=self._objection)
        if self._is_repeated(pending):
            pending = self._unseen(rng) or pending
        self._asked += 1
        candidate = self.layout.candidate(pending.point, origin=self.name, rationale=pending.why)
        self._pending[candidate.key] = pending
        return candidate

    def _objection(self, pending: Pending) -> float:
        """Return the excess risk that its simulation fails, plus 1 if that would repeat another one.

        A plan that repeats one has found nothing else: another one would take as long and repeat one, too.
        """
        return self._risk(pending) + (pending.forecast is None and self._is_repeated(pending))

    def _is_repeated(self, pending: Pending) -> bool:
        return is_seen(pending.point, self._tried)

    def _unseen(self, rng: np.random.Generator) -> Pending | None:
        """Return a random point that has not been simulated; None if all draws have been."""
        points = self.layout.settled(rng.random((_DRAWS, self.layout.dimension)))
        tried = self._tried
        point = next((p for p in points if not is_seen(p, tried)), None)
        return None if point is None else Pending("random", point, "random: all other ideas were simulated")

    @property
    def _tried(self) -> Array:
        """Points that were simulated or are about to be, shape (m, d)."""
        asked = [p.point for p in self._pending.values()] + self._failed
        return np.concatenate([self.history.points, np.array(asked).reshape(-1, self.layout.dimension)])

    def _risk(self, pending: Pending) -> float:
        """Return the excess risk that its simulation fails; plans and the direct search considered it."""
        if pending.arm == "direct" or pending.forecast is not None:
            return 0.0
        return float(self.feasibility.excess(self.layout, pending.point[None])[0])

    def _propose(self, rng: np.random.Generator) -> Pending:
        kind = self._opening[self._asked] if self._asked < len(self._opening) else ""
        if not self.problem.space.inputs and not self._walk.settled:
            # With parameters only, there are few extremes, and they often violate.
            kind = "constant"
        if kind == "constant" and (levels := self._walk.next(rng)) is not None:
            point = self.layout.constant(levels)
            return Pending("constant", point, "constant extremes", levels)
        if kind == "switching":
            return self._switch(rng)
        if kind == "stepping":
            point = stepping(self.layout, rng, self.settings.probe_pieces)
            return Pending("stepping", point, "steps through many levels of each input")
        if len(self.history.samples) < 2:
            point = random_points(self.layout, rng, 1)[0]
            return Pending("random", point, "random: too few simulations to learn from yet")
        arm = self._choose_arm(rng)
        if arm == "coverage":
            idea = self._explorer.propose(rng)
            return Pending("coverage", idea.point, idea.why)
        if arm == "levels":
            idea = self._explorer.propose(rng, aimed=True)
            return Pending("levels", idea.point, f"levels of the context files: {idea.why}")
        if arm == "dynamics":
            return self._plan(rng)
        return self._switch(rng) if arm == "switching" else self._search(rng)

    def _choose_arm(self, rng: np.random.Generator) -> str:
        settings = self.settings
        if self._explorer.has_levels and rng.random() < self._aims.share:
            return "levels"
        costs = self.history.direct_costs()
        is_flat = len(costs) >= settings.flat_start and flatness(costs) >= settings.flat
        # Where all outputs are continuous, the dynamics know how they leave a plateau.
        if is_flat and self._explorer.has_modes:
            # Once something is better than the plateau, that is a lead, too.
            share = settings.coverage_led_share if has_lead(costs) else settings.coverage_share
            if rng.random() < share:
                return "coverage"
        if self._planned < settings.trial and rng.random() < settings.trial_share:
            return "dynamics"
        arms = [s.arm for s in self.history.samples]
        may_switch = bool(self._windows) and arms.count("switching") < settings.most_bangs
        names = ("dynamics", "direct", "switching") if may_switch else ("dynamics", "direct")
        qualities = {
            name: quality(name, arms, costs, window=settings.bandit_window, power=settings.bandit_power)
            for name in names
        }
        if self.dynamics.is_trusted and qualities["dynamics"] == max(qualities.values()):
            return "dynamics" if rng.random() < settings.trusted_share else "direct"
        return choose_arm(qualities, rng, least=settings.least_share)

    def _switch(self, rng: np.random.Generator) -> Pending:
        dwell = float(rng.choice(self._windows)) * float(rng.choice([0.25, 0.5]))
        why = f"inputs take a random bound{_pace(self.layout, dwell)}"
        return Pending("switching", switching(self.layout, rng, dwell), why)

    def _plan(self, rng: np.random.Generator) -> Pending:
        settings, samples = self.settings, self.history.samples
        objective = self.history.scaled_objective()
        order = self._fit(rng)
        points, elites = self.history.points, order[: settings.elites]
        suggested = np.array(self._suggested).reshape(-1, self.layout.dimension)
        self._suggested = []
        # The exact extreme may violate if what stands for it is the best sample so far.
        replaced = [extreme for extreme, robustness in self._stood_for if robustness > self._lowest]
        result = plan(
            self._with_risk(self.dynamics.predictor(self.layout, objective)),
            self.layout,
            elites=np.concatenate([suggested, points[elites]]),
            critical=np.array([*(1.0 for _ in suggested), *(samples[i].critical for i in elites)]),
            seen=np.concatenate([self._tried, np.array(replaced).reshape(-1, self.layout.dimension)]),
            settings=self._plan_settings(),
            snap=0.0 if self.dynamics.is_exact else settings.snap * settings.snap_decay**self._simple,
            rng=rng,
        )
        self._planned += 1
        self._simple += result.is_simple
        why = (
            f"the {self.dynamics.chosen} dynamics predict a scaled robustness of {result.cost:.3g}"
            f"{', preferred for its simple shape' if result.is_simple else ''}"
        )
        forecast = self.dynamics.forecast(self.layout, objective, result.point)
        return Pending("dynamics", result.point, why, forecast=forecast)

    def _plan_settings(self) -> Settings:
        settings = self.settings
        if not self.dynamics.is_exact:
            return settings
        share = settings.exact_share / max(self.dynamics.load, 1.0)
        pool, children = (max(round(share * n), settings.parents) for n in (settings.pool, settings.children))
        return replace(settings, pool=pool, children=children)

    def _with_risk(self, predict: Callable[[Array], Array]) -> Callable[[Array], Array]:
        """Return predicted costs that also count the risk of a failure, if there has been one."""
        if not self.feasibility.has_failures:
            return predict
        weight = self.settings.risk_weight
        return lambda points: predict(points) + weight * self.feasibility.excess(self.layout, points)

    def _fit(self, rng: np.random.Generator) -> NDArray[np.intp]:
        """Fit the dynamics; return the indices of the samples, those with the lowest robustness first."""
        samples = self.history.samples
        objective = self.history.scaled_objective()
        order = np.argsort(scaled_costs(samples, objective), kind="stable")
        best = [int(i) for i in order[: self.settings.best_count]]
        traces = [s.trace for s in samples]
        automaton = self.history.automaton(self.seed)
        self.dynamics.fit(traces, best, rng, automaton=automaton, switched=objective.is_relaxed)
        return order

    def _search(self, rng: np.random.Generator) -> Pending:
        samples, horizon = self.history.samples, self.grid.step * self.grid.cells
        # What a predicate does in the rest of an inner window counts, too.
        rest = min(self._windows, default=0.0)
        decided = np.array([s.critical * horizon + rest for s in samples])
        if self.history.scaled_objective().is_relaxed:
            # A plateau is decided anywhere: relaxed formulas may be decided later.
            decided[:] = horizon
        seen = Seen(self.history.points, np.array(self.history.direct_costs()), decided)
        risk = partial(self.feasibility.excess, self.layout) if self.feasibility.has_failures else None
        draw = propose(seen, self.layout, self.settings, rng, risk)
        return Pending("direct", draw.point, draw.why)


def _pace(layout: Layout, dwell: float) -> str:
    """Say how often switching inputs can change: control points may be further apart than the dwell time."""
    paces: dict[str, list[str]] = {}
    for r, coding in zip(layout.space.inputs, layout.codings, strict=True):
        pace = f"every {dwell:.3g} s, a fraction of an inner window"
        if len(coding.times) < 2:
            pace = "for the whole simulation"
        elif (gap := coding.times[1] - coding.times[0]) > dwell:
            pace = f"at each control point, {gap:.3g} s apart"
        paces.setdefault(pace, []).append(r.name)
    if len(paces) == 1:
        return f" {next(iter(paces))}"
    return ": " + "; ".join(f"{' and '.join(names)} {pace}" for pace, names in paces.items())
