from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.engines.box import Array
from falsifier.engines.surrogate import Settings
from falsifier.engines.surrogate.coordinates import choose_coordinates
from falsifier.engines.surrogate.dynamics import DeviationDynamics, FourierDynamics, StartState
from falsifier.engines.surrogate.grid import Grid, Trace, grid_inputs
from falsifier.engines.surrogate.history import History
from falsifier.engines.surrogate.layout import planning_layout, region_layouts
from falsifier.engines.surrogate.planning import plan
from falsifier.engines.surrogate.trust_region import TrustRegion
from falsifier.engines.surrogate.variation import mutations, random_points, stepping, switching
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.problem import Problem
from falsifier.stl import parse
from falsifier.testing import lag_problem

SETTINGS = Settings()


def history_of(problem: Problem, *, simulations: int, seed: int = 0) -> History:
    interval = problem.experiment.output_interval
    horizon = problem.requirement.formula.horizon(interval)
    grid = Grid.over(horizon, problem.space.stop_time, cells=50, shortest=interval)
    history = History(problem, grid, planning_layout(problem.space, grid), SETTINGS)
    rng = np.random.default_rng(seed)
    for point in random_points(history.layout, rng, simulations):
        history.add(evaluate(problem, history.layout.candidate(point, origin="t", rationale="t")), "t")
    return history


@pytest.mark.parametrize("dynamics", [FourierDynamics, DeviationDynamics])
def test_dynamics_predict_an_unseen_input_from_a_few_trajectories(
    dynamics: type[FourierDynamics] | type[DeviationDynamics],
) -> None:
    history = history_of(lag_problem(free=True, inputs=2), simulations=12)
    traces = [s.trace for s in history.samples]
    fitted = dynamics(traces[:-2], [0, 1, 2], SETTINGS, np.random.default_rng(0))
    start = StartState(traces[:-2])
    for trace in traces[-2:]:
        inputs = trace.inputs[None, :50]
        predicted = fitted.predict(inputs, start.predict(inputs)).states[0, :, 0]
        true = trace.states[:51, 0]
        assert np.abs(predicted - true).max() < 0.25 * np.ptp(true)


def test_an_envelope_sees_the_peak_between_two_grid_points() -> None:
    problem = lag_problem("G[0,10] (y <= 3)", free=True, parameters=0)
    history = history_of(problem, simulations=1)
    times = np.linspace(0, 10, 201)
    spike = np.where(np.abs(times - 5.1) < 0.01, 2.0, 0.0)
    candidate = history.layout.candidate(np.full(history.layout.dimension, 0.5), origin="t", rationale="t")
    spiked = evaluate(problem, candidate)
    assert spiked.trajectory is not None
    columns = {**spiked.trajectory.columns, "y": spike}
    sample = history.add(replace(spiked, trajectory=Trajectory(times, columns)), "t")
    assert sample is not None and history.objective is not None
    assert np.abs(sample.trace.states[:, 0]).max() == 0.0
    assert history.objective.cost(sample.values)[0] == pytest.approx(1.0)


def test_outputs_that_are_only_compared_with_each_other_become_differences() -> None:
    times = np.linspace(0, 10, 11)
    rng = np.random.default_rng(0)
    outputs = ("y1", "y2", "y3", "z")
    trajectory = Trajectory(times, {name: rng.standard_normal(11) for name in outputs})
    relative = choose_coordinates(parse("G[0,9] (y2 - y1 <= 4)"), outputs, {}, trajectory)
    assert relative.families == ((0, 1, 2),)
    values = relative.of(trajectory)
    assert values[:, 0] == pytest.approx(trajectory["y2"] - trajectory["y1"])
    columns = relative.columns(values)
    assert columns["y3"] - columns["y1"] == pytest.approx(trajectory["y3"] - trajectory["y1"])
    assert columns["z"] == pytest.approx(trajectory["z"])
    absolute = choose_coordinates(parse("G[0,9] (y2 - y1 <= 4 and y3 > 0)"), outputs, {}, trajectory)
    assert absolute.families == ()
    assert absolute.columns(absolute.of(trajectory))["y1"] == pytest.approx(trajectory["y1"])


def test_layouts_keep_to_the_allowed_parameterization() -> None:
    free, fixed = lag_problem(free=True, inputs=2), lag_problem(inputs=2)
    grid = Grid.over(10.0, 10.0, cells=100, shortest=0.05)
    rng = np.random.default_rng(0)
    for problem in (free, fixed):
        for layout in (planning_layout(problem.space, grid), *region_layouts(problem.space, grid, (5, 8))):
            points = [*random_points(layout, rng, 5), switching(layout, rng, 0.7), stepping(layout, rng, 12)]
            points += list(mutations(layout, rng, np.array(points), 20, critical=np.full(7, 0.5)))
            for point in points:
                candidate = layout.candidate(point, origin="t", rationale="t")
                assert problem.space.admit(candidate).key == candidate.key
                assert layout.point(candidate) == pytest.approx(point, abs=1e-9)
    assert len(planning_layout(free.space, grid).codings[0].times) == 100
    assert len(planning_layout(fixed.space, grid).codings[0].times) == 4
    assert [len(r.codings[0].times) for r in region_layouts(free.space, grid, (5, 8))] == [5, 8]
    assert len(region_layouts(fixed.space, grid, (5, 8))) == 1


def test_grid_inputs_of_a_point_and_of_its_candidate_agree() -> None:
    problem = lag_problem(free=True)
    grid = Grid.over(10.0, 10.0, cells=50, shortest=0.05)
    layout = planning_layout(problem.space, grid)
    (point,) = random_points(layout, np.random.default_rng(4), 1)
    candidate = layout.candidate(point, origin="t", rationale="t")
    assert layout.inputs(point[None], grid)[0] == pytest.approx(grid_inputs(problem.space, grid, candidate))


def test_changes_near_the_critical_time_leave_what_comes_later_alone() -> None:
    problem = lag_problem(free=True, parameters=0)
    grid = Grid.over(10.0, 10.0, cells=100, shortest=0.05)
    layout = planning_layout(problem.space, grid)
    parents = np.full((1, 100), 0.5)
    rng = np.random.default_rng(0)

    def late_changes(critical: float | None) -> float:
        known = None if critical is None else np.array([critical])
        children = mutations(layout, rng, parents, 400, critical=known)
        return float(np.mean(children[:, 45:] != 0.5))

    assert late_changes(0.3) < 0.7 * late_changes(None)


def test_a_plan_finds_the_best_point_and_prefers_simple_ones_that_are_nearly_as_good() -> None:
    problem = lag_problem(free=True, parameters=0)
    grid = Grid.over(10.0, 10.0, cells=20, shortest=0.05)
    layout = planning_layout(problem.space, grid)
    target = (np.arange(20) < 7).astype(float)

    def distance(points: Array) -> Array:
        return np.asarray(np.abs(points - target).sum(axis=1))

    def planned(snap: float) -> tuple[float, bool]:
        result = plan(
            distance,
            layout,
            elites=np.zeros((1, 20)),
            critical=np.ones(1),
            seen=np.zeros((1, 20)),
            settings=Settings(),
            snap=snap,
            rng=np.random.default_rng(0),
        )
        return result.cost, result.is_simple

    assert planned(0.0)[0] < 1.0
    # The constant 0 is seen already, so that the constant 1 is the simple one.
    assert planned(20.0) == (13.0, True)


def test_trust_region_follows_the_best_and_ends() -> None:
    rng = np.random.default_rng(0)
    region = TrustRegion(4, SETTINGS)
    target = np.array([0.0, 1.0, 0.3, 0.6])
    costs = []
    for _ in range(60):
        point = region.ask(rng)
        costs.append(float(((point - target) ** 2).sum()))
        region.tell(point, costs[-1])
    assert min(costs) < 0.02 < min(costs[:16])
    stuck = TrustRegion(2, SETTINGS)
    for _ in range(80):
        stuck.tell(stuck.ask(rng), 1.0)
    assert stuck.is_exhausted


def test_history_skips_what_has_no_trajectory_and_keeps_failures_out() -> None:
    problem = lag_problem(free=True)
    history = history_of(problem, simulations=2)
    evaluation = evaluate(problem, history.layout.candidate(history.points[0], origin="t", rationale="t"))
    assert history.add(replace(evaluation, trajectory=None), "t") is None
    assert history.add(replace(evaluation, status="failed", verdict=None), "t") is None
    assert len(history.samples) == 2


def test_traces_beyond_the_horizon_teach_too() -> None:
    history = history_of(lag_problem("G[0,2] (y <= 3)", free=True), simulations=1)
    trace: Trace = history.samples[0].trace
    assert trace.inputs.shape[0] > history.grid.cells
