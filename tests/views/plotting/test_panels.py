from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Freedom
from falsifier.core.signals import Signal
from falsifier.evaluation.evaluate import evaluate
from falsifier.stl import parse
from falsifier.testing import lag_problem
from falsifier.views.plotting.panels import judged_windows, panels


@pytest.mark.parametrize(
    ("formula", "windows"),
    [
        ("x <= 1", [(0.0, 0.0)]),
        ("G[2,5] (x <= 1)", [(2.0, 5.0)]),
        ("G[2,5] F[1,3] (x <= 1)", [(3.0, 8.0)]),
        ("G (x <= 1)", [(0.0, np.inf)]),
        ("(G[0,4] (x <= 1)) -> (F[2,6] (x > 0))", [(0.0, 4.0), (2.0, 6.0)]),
        # The left side of until counts from its own time on.
        ("(x >= 0) U[2,5] (u >= 1)", [(0.0, 5.0), (2.0, 5.0)]),
    ],
)
def test_predicates_count_within_all_windows_around_them(
    formula: str, windows: list[tuple[float, float]]
) -> None:
    assert [window for _, window in judged_windows(parse(formula))] == windows


def test_each_compared_quantity_has_a_panel_and_then_each_input() -> None:
    problem = lag_problem("G (0.9 >= x) and G[2,4] (x >= 0) and F[0,5] (x - u <= 0)")
    step = Candidate({"u": Signal((0.0, 4.0), (1.0, 0.0), "constant")})
    formula, found = problem.requirement.formula, evaluate(problem, step)
    assert found.trajectory is not None
    first, second, last = panels(formula, found.trajectory, step, problem.space.inputs, found.verdict, {})
    assert [p.title for p in (first, second, last)] == ["x [m]", "x - u", "u [V]"]
    assert [(b.predicate, b.start, b.end) for b in first.bounds] == [
        ("0.9 >= x", 0.0, 10.0),
        ("x >= 0", 2.0, 4.0),
    ]
    assert set(first.bounds[0].values.tolist()) == {0.9}
    assert second.values.tolist() == (first.values - last.values).tolist()


def test_a_step_that_is_sampled_and_held_is_drawn_where_the_model_gets_it() -> None:
    problem = lag_problem(free=Freedom(5, 0.1))
    held = tuple(replace(r, hold=1.0) for r in problem.space.inputs)
    problem = replace(problem, space=replace(problem.space, inputs=held))
    step = problem.space.admit(Candidate({"u": Signal((0.0, 2.5), (0.0, 1.0), "constant")}))
    found = evaluate(problem, step)
    assert found.trajectory is not None
    last = panels(problem.requirement.formula, found.trajectory, step, held, found.verdict, {})[-1]
    assert last.points == ((0.0, 0.0), (3.0, 1.0))
    assert last.values.tolist() == found.trajectory["u"].tolist()
