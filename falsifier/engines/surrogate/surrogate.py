"""The surrogate engine: arms that search in different ways on one history, rated by what they bring."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.engines.box import BoxEngine
from falsifier.engines.coverage import Explorer, Ladder
from falsifier.engines.layout import Array, TimeGrid, planning_layout
from falsifier.engines.optimisers.bayesian import Bayesian
from falsifier.engines.optimisers.cma import CMA
from falsifier.engines.simple import Corners, Uniform
from falsifier.engines.surrogate.dynamics import Forecasts, LinearDynamics
from falsifier.engines.surrogate.feasibility import Feasibility
from falsifier.engines.surrogate.history import History
from falsifier.engines.surrogate.planning import Push, Pushes, is_seen, plan
from falsifier.engines.surrogate.policy import Policy, worth
from falsifier.engines.surrogate.predicted_cost import Margins, inner_windows, needs_several
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.variation import propose_change, random_points, stepping, switching
from falsifier.evaluation.evaluate import Evaluation
from falsifier.evaluation.levels import Levels
from falsifier.problem.problem import Problem
from falsifier.stl import Verdict

# Random points among which one that was not simulated is looked for, where all other ideas were.
_DRAWS = 1000
# Arms that think for long: if what they propose was simulated, others are asked.
_SLOW = ("dynamics", "region", "cma")
# How often another engine is asked for one candidate.
_REQUESTS = 3
# Maximum number of simulations from which dynamics are learnt, the best and the latest.
_MOST_TRACES = 60
# Mean rank, from 0, of the simulation from which deviations are learnt: around the very best alone, the same
# wrong prediction would be made again and again.
_MEAN_RANK = 1.0
# Number of best simulated inputs from which a plan is bred.
_ELITES = 8
# Maximum number of constant extremes before anything is learnt where there are only parameters.
_CORNERS = 8
# Number of levels of an input that steps through many.
_LEVELS_OF_STEPS = 12
# Maximum number of switching inputs: if that many random ones did not violate, more will not.
_MOST_SWITCHING = 8
# Share of each range within which another engine's constant input stands for the extreme.
_NEAR_EXTREME = 0.1
# Rating of each arm before its first proposals. Dynamics need a few proposals to become good; of the others,
# those that use what was simulated come first.
_PRIORS = {
    "dynamics": 0.8,
    "changes": 0.3,
    "levels": 0.3,
    "push": 0.15,
    "region": 0.2,
    "switching": 0.2,
    "coverage": 0.1,
    "context": 0.2,
    "uniform": 0.1,
    "corners": 0.1,
    "cma": 0.1,
}
# Without inputs there is no time in which dynamics would tell more than the final robustness.
_PRIORS_OF_PARAMETERS = _PRIORS | {"region": 0.8, "dynamics": 0.3}
# Reserved shares where levels lead: going on from what reached the lowest one, or from what is rare.
_WHERE_LEVELS_LEAD = {"levels": 0.55, "coverage": 0.2}
# The same where there are only parameters, which the region searches best.
_OF_PARAMETERS = {"region": 0.7}
# The arms with a share of turns that no rating takes away.
_SIMPLE = ("coverage", "uniform", "corners", "cma")
# Of these, those that do not go on from what was reached: something new that they reach is chance, no merit.
_BLIND = _SIMPLE[1:]


@dataclass(frozen=True, slots=True, eq=False)
class Pending:
    """What the engine remembers about a candidate until it is told its evaluation."""

    arm: str  # the arm that proposed it
    candidate: Candidate
    point: Array  # its point in the layout, in [0, 1]^d
    predicted: Margins | None = None  # margins that the dynamics predicted, if they proposed it
    push: Push | None = None  # what it drives further than before, if that is its aim


class Surrogate:
    """Plans on learnt dynamics, and searches in simpler ways beside that.

    Each way is an arm; an arm that brings more has more turns, and none of the simple ones loses all of them.
    """

    name = "surrogate"

    def __init__(self, problem: Problem, *, seed: int, settings: Settings | None = None) -> None:
        self.problem, self.seed, self.settings = problem, seed, settings or Settings()
        space, formula = problem.space, problem.requirement.formula
        self.grid = TimeGrid.of(problem, cells=self.settings.cells)
        self.layout = planning_layout(space, self.grid)
        self.history = History(problem, self.grid, self.layout)
        self.feasibility = Feasibility(self.layout, self.grid)
        self.forecasts = Forecasts()
        # Where repeating helps, the robustness has steps, and the ladder repeats.
        self._explorer = Explorer(problem, self.layout, repeats=False)
        self._ladder = Ladder(problem, self._explorer.programs)
        self._corners = Corners(problem, seed=seed)
        self._engines: dict[str, BoxEngine] = {
            "region": Bayesian(problem, seed=seed),
            "uniform": Uniform(problem, seed=seed),
            "corners": self._corners,
            "cma": CMA(problem, seed=seed),
        }
        self._policy = Policy(_PRIORS if space.inputs else _PRIORS_OF_PARAMETERS)
        self._levels = Levels()
        self._pushes = Pushes()
        self._windows = [w for w in inner_windows(formula) if w >= self.grid.step] if space.inputs else []
        self._opening = self._first_kinds()
        self._asked = self._switched = 0
        self._pending: dict[object, Pending] = {}
        self._suggested: list[Array] = []
        self._failed: list[Array] = []

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n candidates, each from the arm that is chosen for it."""
        return [self._ask_one() for _ in range(max(n, 1))]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Add the evaluations to the history; those of its own candidates also rate arms and forecasts."""
        for evaluation in evaluations:
            pending = self._pending.pop(evaluation.candidate.key, None)
            point = self.layout.point(evaluation.candidate) if pending is None else pending.point
            sample = self.history.add(evaluation, point)
            self.feasibility.add(point, failed=sample is None)
            for engine in self._engines.values():
                engine.tell([evaluation])
            brought, is_new = 0.0, False
            if sample is None:
                self._failed.append(point)
            else:
                brought = worth(self._levels, sample.robustness)
                assert evaluation.trajectory is not None and evaluation.verdict is not None, "it is judged"
                is_new = self._explorer.learn(point, evaluation.trajectory)
                self._ladder.learn(point, evaluation.trajectory, evaluation.verdict)
                self._pushes.know(self.history.outputs, self.history.continuous)
            if pending is not None:
                if pending.push and is_new:
                    self._pushes.succeeded(pending.push)
                self._policy.learn(pending.arm, brought, is_new=is_new and pending.arm not in _BLIND)
                if pending.predicted is not None and sample is not None:
                    cost, violated = self.history.scaled_cost(), sample.robustness < 0
                    self.forecasts.judge(pending.predicted, sample.margins, cost, violated=violated)
            elif sample is not None and all(  # constant near a bound
                np.abs(point[g] - np.rint(point[g][0])).max() <= _NEAR_EXTREME for g in self.layout.groups
            ):
                self._corners.hear(self._corners.box.point(evaluation.candidate), sample.robustness)

    def foresee(self, candidates: Sequence[Candidate]) -> list[Verdict]:
        """Return the verdicts that the dynamics predict for candidates, without simulating them.

        The robustness is in the requirement's own unit. The list is empty until two simulations are known.
        It changes nothing: what is asked next is the same without it.
        """
        if len(self.history.samples) < 2 or not candidates:
            return []
        rng = np.random.default_rng([self.seed, self._asked, len(self.history.samples)])
        dynamics = self._fitted(self.history.by_scaled_cost(), rng)
        margins = self._margins(dynamics, np.array([self.layout.point(c) for c in candidates]))
        assert self.history.cost is not None, "there are samples"
        return self.history.cost.verdicts(margins)

    def suggest(self, candidates: Sequence[Candidate]) -> None:
        """Add candidates to those from which the next plan is bred."""
        self._suggested = [self.layout.point(c) for c in candidates]

    def _first_kinds(self) -> list[str]:
        """Return the kinds of the first inputs, in order.

        Formulas with nested windows are violated by inputs that change a few times per inner window, so
        switching inputs come first. Requirements that a single extreme can violate start with one, and with a
        program, which shows more of the dynamics than another extreme. If a violation requires several
        conditions at once, stepping inputs show how the outputs depend on the inputs.
        """
        settings = self.settings
        if not self.problem.space.inputs:
            return ["corners"] * min(_CORNERS, 2 ** len(self.problem.space.parameters))
        if self._windows:
            turns = zip_longest(["switching"] * settings.bangs, ["corners"] * settings.pauses)
            return [kind for turn in turns for kind in turn if kind is not None]
        if needs_several(self.problem.requirement.formula):
            return ["stepping"] * settings.probes
        return ["corners"] * settings.constants + ["program"]

    def _ask_one(self) -> Candidate:
        rng = np.random.default_rng([self.seed, self._asked])
        left_out: set[str] = set()
        pending = self._propose(rng, left_out)
        for _ in range(self.settings.retries):
            if self._objection(pending) == 0.0:
                break
            if pending.arm in _SLOW and is_seen(pending.point, self._tried):
                left_out.add(pending.arm)
            pending = min(pending, self._propose(rng, left_out), key=self._objection)
        if is_seen(pending.point, self._tried):
            pending = self._unseen(rng) or pending
        self._asked += 1
        self._pending[pending.candidate.key] = pending
        return pending.candidate

    def _objection(self, pending: Pending) -> float:
        """Return the excess risk that its simulation fails, plus 1 if that would repeat another one.

        Plans and changes have considered the risk, and the evolution strategy waits for each of its points.
        """
        considered = pending.arm in ("dynamics", "changes", "cma")
        risk = 0.0 if considered else float(self.feasibility.excess(pending.point[None])[0])
        return risk + is_seen(pending.point, self._tried)

    def _unseen(self, rng: np.random.Generator) -> Pending | None:
        """Return a random point that has not been simulated; None if all draws have been."""
        points = self.layout.settled(rng.random((_DRAWS, self.layout.dimension)))
        tried, why = self._tried, "random: all other ideas were simulated"
        return next((self._made("random", p, why) for p in points if not is_seen(p, tried)), None)

    @property
    def _tried(self) -> Array:
        """Points that were simulated or are about to be, shape (m, d)."""
        asked = [p.point for p in self._pending.values()] + self._failed
        return np.concatenate([self.history.points, np.array(asked).reshape(-1, self.layout.dimension)])

    def _propose(self, rng: np.random.Generator, left_out: Collection[str]) -> Pending:
        is_opening = self._asked < len(self._opening)
        arm = self._opening[self._asked] if is_opening else self._choose(rng, left_out)
        if engine := self._engines.get(arm):
            return self._asked_of(arm, engine)
        match arm:
            case "switching":
                return self._switch(rng)
            case "stepping":
                point = stepping(self.layout, rng, _LEVELS_OF_STEPS)
                return self._made(arm, point, "steps through many levels of each input")
            case "program":
                return self._made(arm, self._explorer.programs.fresh(rng), "a random program of the inputs")
            case "dynamics":
                return self._plan(rng)
            case "changes":
                return self._change(rng)
            case "push":
                return self._push(rng)
            case "random":
                point = random_points(self.layout, rng, 1)[0]
                return self._made(arm, point, "random: too few simulations to learn from yet")
            case "levels":
                idea = self._ladder.propose(rng)
                return self._made(arm, idea.point, idea.rationale)
        idea = self._explorer.propose(rng, aimed=arm == "context")
        why = f"levels of the context files: {idea.rationale}" if arm == "context" else idea.rationale
        return self._made(arm, idea.point, why)

    def _asked_of(self, arm: str, engine: BoxEngine) -> Pending:
        """Ask another engine; what it asks for although it was simulated is told to it at once."""
        for _ in range(_REQUESTS):
            (candidate,) = engine.ask()
            point = self.layout.point(candidate)
            known = next((s for s in self.history.samples if is_seen(point, s.point[None])), None)
            if known is None:
                break
            engine.tell([Evaluation(candidate, verdict=Verdict(known.robustness, 0.0, ""))])
        return Pending(arm, replace(candidate, origin=self.name), point)

    def _made(self, arm: str, point: Array, why: str) -> Pending:
        point = self.layout.settled(point)  # so that equal candidates have equal points
        return Pending(arm, self.layout.candidate(point, origin=self.name, rationale=why), point)

    def _choose(self, rng: np.random.Generator, left_out: Collection[str]) -> str:
        """Choose among the arms that can propose something now, without those left out."""
        if len(self.history.samples) < 2:
            return "random"
        has_inputs, differs = bool(self.problem.space.inputs), not self._levels.is_plateau
        lead, is_fine = has_inputs and self._levels.is_staircase, any(self.layout.is_fine)
        can = {
            # Of signals with few values, dynamics that are linear know nothing.
            "dynamics": differs and not self._levels.is_staircase,
            # Of few control points, a model needs fewer simulations than changes do; of many cells, more.
            # Where levels lead, they do what a change would.
            "changes": differs and is_fine and not lead,
            "region": differs and not is_fine,
            "cma": differs,
            "corners": not self._corners.is_done,
            "switching": bool(self._windows) and self._switched < _MOST_SWITCHING,
            "coverage": has_inputs,
            "context": self._explorer.has_levels,
            "levels": lead,
            "push": (lead or (has_inputs and not differs)) and not self._pushes.is_done,
        }
        arms = [arm for arm in _PRIORS if can.get(arm, True) and arm not in left_out]
        is_trial = self._asked < len(self._opening) + self.settings.trial
        reserved = {} if is_trial else dict.fromkeys(_SIMPLE, self.settings.reserved)
        leading = _WHERE_LEVELS_LEAD if lead else {} if has_inputs or is_trial else _OF_PARAMETERS
        return self._policy.choose(arms, reserved | leading, rng)

    def _switch(self, rng: np.random.Generator) -> Pending:
        self._switched += 1
        dwell = float(rng.choice(self._windows)) * float(rng.choice([0.25, 0.5]))
        why = f"inputs take a random bound every {dwell:.3g} s, or at control points that are further apart"
        return self._made("switching", switching(self.layout, rng, dwell), why)

    def _plan(self, rng: np.random.Generator) -> Pending:
        order, cost = self.history.by_scaled_cost(), self.history.scaled_cost()
        dynamics, weight = self._fitted(order, rng), self.settings.risk_weight

        def predict(points: Array) -> Array:
            return cost.cost(self._margins(dynamics, points)) + weight * self.feasibility.excess(points)

        elites = [self.history.samples[i] for i in order[:_ELITES]]
        points = [*self._suggested, *(e.point for e in elites)]
        critical = [*(1.0 for _ in self._suggested), *(e.critical for e in elites)]
        self._suggested = []
        point = self._planned(predict, np.array(points), np.array(critical), rng)
        predicted = self._margins(dynamics, point[None])
        why = f"the learnt dynamics predict a scaled robustness of {float(cost.cost(predicted)[0]):.3g}"
        return replace(self._made("dynamics", point, why), predicted=predicted)

    def _push(self, rng: np.random.Generator) -> Pending:
        """Plan what drives an output further than before."""
        push, cells = self._pushes.next(rng), self.grid.cells
        heights = np.array([push.heights(s.trace.states[: cells + 1]) for s in self.history.samples])
        order = np.argsort(-heights.max(axis=1), kind="stable").tolist()
        dynamics, elites = self._fitted(order, rng), order[:_ELITES]

        def predict(points: Array) -> Array:
            states = dynamics.predict(self.layout.inputs(points, self.grid))
            return np.asarray(-push.heights(states).max(axis=1))

        highest = np.argmax(heights[elites], axis=1) / cells
        point = self._planned(predict, self.history.points[elites], highest, rng)
        return replace(self._made("push", point, str(push)), push=push)

    def _planned(
        self, predict: Callable[[Array], Array], elites: Array, critical: Array, rng: np.random.Generator
    ) -> Array:
        return plan(
            predict,
            self.layout,
            elites,
            critical,
            seen=self._tried,
            outputs=len(self.history.outputs),
            settings=self.settings,
            rng=rng,
        )

    def _fitted(self, order: Sequence[int], rng: np.random.Generator) -> LinearDynamics:
        """Return dynamics fitted to the best and the latest simulations."""
        samples = self.history.samples
        latest = range(max(0, len(samples) - _MOST_TRACES), len(samples))
        kept = list(dict.fromkeys([*order[: _MOST_TRACES // 3], *reversed(latest)]))[:_MOST_TRACES]
        base = min(int(rng.exponential(_MEAN_RANK)), len(kept) - 1)
        return LinearDynamics([samples[i].trace for i in kept], base, self.grid.cells, rng)

    def _margins(self, dynamics: LinearDynamics, points: Array) -> Margins:
        """Return the predicted margins of points, shape (m, d)."""
        inputs = self.layout.inputs(points, self.grid)
        return self.history.scaled_cost().margins(dynamics.predict(inputs), inputs)

    def _change(self, rng: np.random.Generator) -> Pending:
        samples, horizon = self.history.samples, self.grid.step * self.grid.cells
        rest = min(self._windows, default=0.0)  # what happens in the rest of an inner window counts, too
        decided = np.array([s.critical * horizon + rest for s in samples])
        robustness = np.array([s.robustness for s in samples])
        draws = max(self.settings.retries, 1) if self.feasibility.has_failures else 1
        risk = self.feasibility.excess
        point, why = propose_change(
            self.layout, self.history.points, robustness, decided, rng, risk=risk, draws=draws
        )
        return self._made("changes", point, why)
