import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import InputRange
from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.evaluate import evaluate
from falsifier.stl import parse
from falsifier.testing import lag_problem
from falsifier.views.plotting.panels import Panel, judged_windows, panels

STEP = Candidate({"u": Signal((0.0, 4.0), (1.0, 0.0), "constant")})


def drawn(formula: str) -> list[Panel]:
    problem = lag_problem(formula)
    found = evaluate(problem, STEP)
    assert found.trajectory is not None
    return panels(
        problem.requirement.formula, found.trajectory, STEP, problem.space.inputs, found.verdict, {}
    )


@pytest.mark.parametrize(
    ("formula", "windows"),
    [
        ("x <= 1", [(0.0, 0.0)]),
        ("G[2,5] (x <= 1)", [(2.0, 5.0)]),
        ("G[2,5] F[1,3] (x <= 1)", [(3.0, 8.0)]),
        ("G (x <= 1)", [(0.0, np.inf)]),
        ("(G[0,4] (x <= 1)) -> (F[2,6] (x > 0))", [(0.0, 4.0), (2.0, 6.0)]),
        # The left side of until counts from its own time on.
        ("(x >= 0) U[2,5] (u >= 1)", [(0.0, 5.0), (0.0, 5.0)]),
    ],
)
def test_predicates_count_within_all_windows_around_them(
    formula: str, windows: list[tuple[float, float]]
) -> None:
    assert [window for _, window in judged_windows(parse(formula))] == windows


def test_each_compared_quantity_has_a_panel_and_then_each_input() -> None:
    first, second, last = drawn("G (0.9 >= x) and G[2,4] (x >= 0) and F[0,5] (x - u <= 0)")
    assert [p.title for p in (first, second, last)] == ["x [m]", "x - u", "u [V]"]
    assert [(b.predicate, b.start, b.end) for b in first.bounds] == [
        ("0.9 >= x", 0.0, 10.0),
        ("x >= 0", 2.0, 4.0),
    ]
    assert set(first.bounds[0].values.tolist()) == {0.9}
    assert second.values.tolist() == (first.values - last.values).tolist()


def test_the_critical_time_is_marked_on_what_decided_only() -> None:
    first, second, last = drawn("G[0,10] (x <= 9) and G[0,10] (u <= 2)")
    assert (first.critical, last.critical) == (None, None)
    assert second.critical == 0.0, "u is nearest to its bound at the start"


def test_what_broke_is_marked_over_its_interval_and_what_decided_apart() -> None:
    broken, last = drawn("G[0,10] (x <= 0.6 or u <= 0.99)")[:2]
    assert (broken.title, last.title) == ("x [m]", "u [V]")
    ((start, end),) = broken.broken
    assert 0.0 < start < end < 4.0 and broken.critical == end
    assert broken.decided is None and last.broken == broken.broken, "both alternatives failed"
    condition, consequence = drawn("G[0,10] (u >= 0.99 -> x <= 0.6)")[:2]
    assert (condition.critical, condition.broken) == (None, ())
    assert condition.decided == start
    assert (consequence.critical, consequence.broken) == (end, ((start, end),))


def test_an_input_is_drawn_with_its_control_points_and_its_range() -> None:
    panel = drawn("G[0,10] (x <= 0.9)")[-1]
    assert (panel.points, panel.limits, panel.steps) == (((0.0, 1.0), (4.0, 0.0)), (-1.0, 1.0), True)
    assert panel.bounds == ()
    assert panel.values[39] == 1.0 and panel.values[41] == 0.0


def test_panels_of_a_system_are_grouped_by_component() -> None:
    times = np.linspace(0.0, 1.0, 3)
    names = ("plant.y", "plant.inner.y", "pi.y", "pi.r")
    trajectory = Trajectory(times, {name: times for name in names}, {})
    formula = parse("G (pi.y <= 1 and plant.y <= 2 and plant.inner.y <= 3 and plant.y - pi.y <= 4)")
    candidate = Candidate({"pi.r": Signal((0.0,), (1.0,), "constant")})
    components = ("plant", "pi", "plant.inner")
    ranges = (InputRange("pi.r", 0.0, 2.0),)
    found = panels(formula, trajectory, candidate, ranges, None, {}, components)
    assert [(p.title, p.component) for p in found] == [
        ("plant.y - pi.y", ""),
        ("plant.y", "plant"),
        ("pi.y", "pi"),
        ("pi.r", "pi"),
        ("plant.inner.y", "plant.inner"),
    ]
    single = panels(formula, trajectory, candidate, ranges, None, {})
    assert [p.title for p in single][:2] == ["pi.y", "plant.y"] and not any(p.component for p in single)
