"""What was simulated, what is learnt from it, and the robustness that is predicted."""

import numpy as np
import pytest

from falsifier.core.space import SearchSpace
from falsifier.engines.layout import TimeGrid, planning_layout
from falsifier.engines.surrogate.corrections import Corrections
from falsifier.engines.surrogate.dynamics import LinearDynamics, Trace
from falsifier.engines.surrogate.history import History
from falsifier.engines.surrogate.predicted_cost import PredictedCost
from falsifier.engines.surrogate.variation import random_points
from falsifier.evaluation.evaluate import evaluate
from falsifier.stl import Monitor, parse
from falsifier.testing import FREE, START, lag_problem

STEP, CELLS = 0.5, 40


@pytest.mark.parametrize(
    "text",
    [
        "G[0,10] (x <= 1)",
        "F[2,10] (x > y)",
        "not G[0,10] (x <= 1 and y > 0)",
        "(G[0,10] (x <= 1)) -> (G[0,4] (y <= 0.5))",
        "(F[0,5] (x > 1)) <-> (F[0,5] (y > 1))",
        "G[0,8] F[0,5] G[0,2] (x >= -0.5)",
        "(x > -1) U[1,6] (y > 0.5)",
        "not ((x > -1) U[1,6] (y > 0.5))",
        "G (x <= 3)",
        "G[0,10] ((not (x > 0) and X (x > 0)) -> X G[0,2.5] (x > 0))",
    ],
)
def test_predicted_robustness_is_the_monitors_where_grid_and_samples_coincide(text: str) -> None:
    formula = parse(text)
    space, grid = SearchSpace((), (), CELLS * STEP), TimeGrid(STEP, CELLS, CELLS)
    cost = PredictedCost.of(formula, space, grid, ("x", "y"), discrete=frozenset(), constants={})
    states = np.random.default_rng(0).standard_normal((20, CELLS + 1, 2))
    margins = cost.margins(states, np.zeros((20, CELLS, 0)))
    true = Monitor(formula, STEP, CELLS + 1).batch({"x": states[..., 0], "y": states[..., 1]})
    assert cost.cost(margins) == pytest.approx(true)
    verdicts = cost.verdicts(margins)
    assert [v.robustness for v in verdicts] == pytest.approx(true.tolist())
    assert {v.predicate for v in verdicts} <= {str(p) for p in formula.predicates}
    assert all(0.0 <= v.critical_time <= CELLS * STEP for v in verdicts)


def test_margins_that_are_undefined_or_infinite_where_nothing_looks_leave_a_scale() -> None:
    space, grid = SearchSpace((), (), CELLS * STEP), TimeGrid(STEP, CELLS, CELLS)
    formula = parse("log(x) <= 1")  # judged at time 0 only
    cost = PredictedCost.of(formula, space, grid, ("x",), discrete=frozenset(), constants={})
    states = np.linspace([2.0, 3.0], [-1.0, 0.0], CELLS + 1).T[..., None]
    margins = cost.margins(states, np.zeros((2, CELLS, 0)))
    scaled = cost.rescaled([margins])
    assert 0.1 < scaled.scales[0] < 10.0, "the spread of what is defined"
    assert scaled.cost(margins) * scaled.scales == pytest.approx(1.0 - np.log([2.0, 3.0]))


@pytest.mark.parametrize("text", ["G[0,10] F[0,0.3] (x > 0)", "G[0.2,19.9] (x > 0)", "F[0,20] X (x > 0)"])
def test_windows_between_grid_points_are_rounded(text: str) -> None:
    space, grid = SearchSpace((), (), CELLS * STEP), TimeGrid(STEP, CELLS, CELLS)
    cost = PredictedCost.of(parse(text), space, grid, ("x",), discrete=frozenset(), constants={})
    states = np.linspace(2.0, 1.0, CELLS + 1)[None, :, None]
    assert 1.0 <= cost.cost(cost.margins(states, np.zeros((1, CELLS, 0))))[0] <= 2.0


def test_dynamics_predict_an_unseen_input_from_a_few_trajectories() -> None:
    problem = lag_problem(free=FREE, inputs=2, parameters=[START])
    grid, rng = TimeGrid.of(problem, cells=50), np.random.default_rng(0)
    history = History(problem, grid, planning_layout(problem.space, grid))
    for point in random_points(history.layout, rng, 12):
        history.add(evaluate(problem, history.layout.candidate(point, origin="t", rationale="t")), point)
    traces = [s.trace for s in history.samples]
    fitted = LinearDynamics(traces[:-2], 0, 50, np.random.default_rng(0))
    for trace in traces[-2:]:
        predicted = fitted.predict(trace.inputs[None, :50])[0, :, 0]
        true = trace.states[:51, 0]
        assert np.abs(predicted - true).max() < 0.05 * np.ptp(true)


def test_inputs_on_the_grid_are_those_of_the_point_and_times_beyond_the_horizon_teach_too() -> None:
    problem = lag_problem("G[0,5] (x <= 3)", free=FREE, parameters=[START])
    grid = TimeGrid.of(problem, cells=25)
    layout = planning_layout(problem.space, grid)
    (point,) = random_points(layout, np.random.default_rng(4), 1)
    evaluation = evaluate(problem, layout.candidate(point, origin="t", rationale="t"))
    sample = History(problem, grid, layout).add(evaluation, point)
    assert sample is not None
    trace = sample.trace
    assert trace.inputs[:25] == pytest.approx(layout.inputs(point[None], grid)[0])
    assert trace.states.shape == (51, 1) and len(trace.inputs) == 50


def test_errors_at_similar_inputs_correct_a_prediction_and_what_comes_later_does_not_matter() -> None:
    rng, cells = np.random.default_rng(1), 23
    inputs = np.broadcast_to(np.array([0.0, 0.4, 0.7, 1.0])[:, None, None], (4, cells, 2))
    errors = rng.standard_normal((4, cells, 3))
    corrections = Corrections(inputs, errors)
    new = inputs[:1].copy()
    new[:, 10:] = 1.0  # something else from then on
    expected = corrections.at(np.concatenate([inputs[:1], new]))
    assert expected.shape == (2, cells, 3)
    assert np.abs(expected[0] - errors[0]).max() < 0.25 * np.abs(errors[0]).max()
    assert expected[1, :10] == pytest.approx(expected[0, :10], abs=1e-6)
    assert np.abs(corrections.at(np.full((1, cells, 2), 5.0))).max() < 1e-6  # nothing is known there


def test_dynamics_do_not_repeat_what_they_got_wrong() -> None:
    # An output that stops at a limit, which linear dynamics overshoot.
    rng, cells = np.random.default_rng(2), 40
    levels = rng.random((12, 1, 1))
    inputs = np.broadcast_to(levels, (12, cells, 1)).copy()
    rising = np.cumsum(np.concatenate([np.zeros((12, 1, 1)), inputs], axis=1), axis=1)
    traces = [Trace(u, y) for u, y in zip(inputs, np.minimum(rising, 12.0), strict=True)]
    highest = int(np.argmax(levels))
    fitted = LinearDynamics(traces, int(np.argmin(levels)), cells, np.random.default_rng(0))
    predicted = fitted.predict(inputs[highest : highest + 1])[0]
    assert np.abs(predicted - traces[highest].states).max() < 2.5  # 4.9 without corrections


def test_huge_outputs_are_corrected_in_their_own_unit() -> None:
    rng = np.random.default_rng(3)
    traces = [Trace(rng.random((10, 1)), 1e80 * rng.standard_normal((11, 1))) for _ in range(3)]
    fitted = LinearDynamics(traces, 0, 10, rng)
    assert np.isfinite(fitted.predict(np.stack([t.inputs for t in traces]))).all()


def test_a_few_simulations_of_many_inputs_teach_no_more_than_they_say() -> None:
    # Twenty inputs act on an oscillator by their mean, which saturates.
    rng, cells = np.random.default_rng(0), 60
    inputs = np.repeat(rng.random((60, 3, 20)), cells // 3, axis=1)
    pull = np.tanh(6.0 * inputs.mean(axis=2) - 3.0)
    states, speed = np.zeros((60, cells + 1, 1)), np.zeros(60)
    for k in range(cells):
        speed += 0.3 * (pull[:, k] - states[:, k, 0] - 0.5 * speed)
        states[:, k + 1, 0] = states[:, k, 0] + 0.3 * speed
    errors = []
    for few in np.arange(60).reshape(5, 12):
        traces = [Trace(inputs[i], states[i]) for i in few[:8]]
        fitted = LinearDynamics(traces, 0, cells, np.random.default_rng(0))
        errors.append(fitted.predict(inputs[few[8:]]) - states[few[8:]])
    assert np.std(errors) < 0.42 * np.std(states)  # 0.35, and 0.5 with hardly any ridge
