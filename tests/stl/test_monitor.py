import pickle
import random
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.errors import FormulaError, MonitorError, SpecError
from falsifier.stl import Monitor, Verdict, parse
from falsifier.stl.margins import ON_LIMIT, is_on_limit
from tests.stl.direct import Direct
from tests.stl.randoms import STEP, random_case, random_trajectory


def trajectory(step: float = 1.0, **columns: list[float]) -> Trajectory:
    n = len(next(iter(columns.values())))
    times = np.arange(n, dtype=np.float64) * step
    return Trajectory(times, {name: np.array(c, dtype=np.float64) for name, c in columns.items()})


def judge(text: str, t: Trajectory) -> tuple[float, float]:
    verdict = Monitor(parse(text), t.step or 1.0, len(t)).evaluate(t)
    return verdict.robustness, verdict.critical_time


@pytest.mark.parametrize("block", range(8))
def test_random_formulas_agree_with_the_direct_definition(block: int) -> None:
    for seed in range(block * 400, (block + 1) * 400):
        formula, t = random_case(seed)
        verdict = Monitor(formula, STEP, len(t)).evaluate(t)
        robustness, sample = Direct(t.columns, STEP).judge(formula)
        found = (verdict.robustness, verdict.critical_time)
        assert found == (robustness, t.times[sample]), (seed, str(formula))


@pytest.mark.parametrize("block", range(4))
def test_the_sign_of_the_robustness_is_the_truth_of_the_formula(block: int) -> None:
    on_limit = [0, 0]
    for seed in range(100_000 + block * 400, 100_000 + (block + 1) * 400):
        formula, t = random_case(seed)
        monitor = Monitor(formula, STEP, len(t))
        robustness, holds = monitor.evaluate(t).robustness, Direct(t.columns, STEP).holds(formula)
        assert (robustness > 0, robustness < 0) == (holds, not holds), (seed, str(formula))
        assert monitor.batch({name: column[None] for name, column in t.columns.items()})[0] == robustness
        on_limit[holds] += is_on_limit(robustness)
    assert min(on_limit) > 10, "both kinds were tried"


# -- values and critical times by hand -----------------------------------------------------------------------

X = [3.0, 1.0, 4.0, 1.0, 5.0]
Y = [2.0, 7.0, 1.0, 8.0, 2.0]


@pytest.mark.parametrize(
    ("text", "robustness", "critical"),
    [
        ("x == 3", ON_LIMIT, 0),
        ("x != 3", -ON_LIMIT, 0),
        ("not (x >= 3)", -ON_LIMIT, 0),
        ("not (x > 3)", ON_LIMIT, 0),
        ("x > 3 or x >= 3", ON_LIMIT, 0),
        ("(X (x <= 1)) and (x < 3)", -ON_LIMIT, 0),  # the operand that is false
        ("G (x <= 4)", -1, 4),
        ("G[1,3] (x <= 4)", ON_LIMIT, 2),
        ("G[1,3] (x >= 0)", 1, 1),  # the earlier of two smallest
        ("F[1,3] (x <= 0)", -1, 1),  # the earlier of two largest
        ("1 + 1 <= 5", 3, 0),
        ("(X (x <= 3)) and (x <= 5)", 2, 1),  # the left operand on ties
        ("not (X (x <= 3)) -> (x <= 5)", 2, 1),
        ("(x <= 5) <-> (X (x <= 3))", 2, 1),
        ("(x <= 4) U (y >= 8)", ON_LIMIT, 2),  # left at its smallest value on ties
        ("(x <= 9) U[0,2] (y >= 9)", -2, 1),
    ],
)
def test_values_and_critical_times(text: str, robustness: float, critical: float) -> None:
    assert judge(text, trajectory(x=X, y=Y)) == (robustness, critical)


def test_arithmetic_and_functions_are_those_of_numpy() -> None:
    x, y = np.array(X), np.array(Y)
    for text, value in {
        "x + y": x + y, "x - 3*y": x - 3 * y, "2 - x": 2 - x, "y/x": y / x, "x^y": x**y, "x^2": x * x,
        "-x + 1": 1 - x, "abs(x - y)": abs(x - y), "sqrt(x)": np.sqrt(x), "exp(x)": np.exp(x),
        "log(y)": np.log(y), "sin(x)": np.sin(x), "cos(y)": np.cos(y),
        "min(x, y, 3)": np.minimum(np.minimum(x, y), 3),
        "max(x, y)": np.maximum(x, y),
    }.items():  # fmt: skip
        found = Monitor(parse(f"{text} >= 0.25"), 1.0, 5).course(trajectory(x=X, y=Y))
        assert found == pytest.approx(value - 0.25), text


# -- the automatic transmission and the chasing cars ---------------------------------------------------------

N, DT = 5001, 0.01


def drive(**columns: np.ndarray) -> Trajectory:
    return Trajectory(np.linspace(0.0, 50.0, N), columns)


@pytest.mark.parametrize(("held", "robustness"), [(2.6, 0.5), (2.4, -0.5)])
def test_a_gear_must_be_held_for_two_and_a_half_seconds(held: float, robustness: float) -> None:
    t = np.linspace(0.0, 50.0, N)
    gear = np.where((t >= 10.0 - 1e-9) & (t < 10.0 + held - 1e-9), 2.0, 1.0)
    g = "(abs(gear - 2) <= 0.5)"
    formula = parse(f"G[0,30] ((not {g} and X {g}) -> X G[0,2.5] {g})")
    verdict = Monitor(formula, DT, N).evaluate(drive(gear=gear))
    assert verdict.robustness == robustness
    if robustness < 0:  # both sides of the implication give -0.5, so its left one decided: the shift itself
        assert verdict.critical_time == pytest.approx(9.99)
        assert verdict.predicate == "abs(gear - 2) <= 0.5"


def test_of_many_signals_a_verdict_keeps_those_of_the_formula_and_some_others() -> None:
    many = Trajectory(np.arange(3.0), {f"y{i}": np.full(3, float(i)) for i in range(100)})
    values = Monitor(parse("G[0,2] (y77 <= 99)"), 1.0, 3).evaluate(many).values
    assert [*values.items()][:2] == [("y77", 77.0), ("y0", 0.0)] and len(values) == 40
    all_of_them = " and ".join(f"y{i} <= 99" for i in range(60))
    assert len(Monitor(parse(all_of_them), 1.0, 3).evaluate(many).values) == 60


def test_a_verdict_names_what_decided_it_and_has_all_values_then() -> None:
    t = np.linspace(0.0, 100.0, 10_001)
    gap = np.where((t > 20.0 + 1e-9) & (t < 60.0 - 1e-9), 7.5, 9.0)
    cars = Trajectory(t, {"y4": np.zeros_like(t), "y5": gap})
    verdict = Monitor(parse("G[0,65] F[0,30] G[0,5] (y5 - y4 >= 8)"), DT, 10_001).evaluate(cars)
    expected = Verdict(-0.5, 20.01, "y5 - y4 >= 8", {"y4": 0.0, "y5": 7.5})
    assert replace(verdict, breach=None) == expected


# -- grids and windows ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("G[0,20] (x <= 3)", ["[0,20]", "20 s", "ends at 10 s"]),
        ("G[0,5] F[0,6] (x <= 3)", ["[0,6]", "11 s"]),
        ("G[0,10] X (x <= 3)", ["10.1 s"]),
        ("G (b -> F[0,5] c)", ["[0,5]", "15 s", "without a window"]),
        ("G[0,0.25] (x <= 3)", ["0.25", "multiple", "0.1 s", "0.2 s"]),
        ("(x <= 3) U[0,11] (y <= 3)", ["[0,11]", "11 s"]),
        ("log(0) <= x", ["log(0)"]),
    ],
)
def test_windows_that_do_not_fit_are_errors(text: str, parts: list[str]) -> None:
    with pytest.raises(FormulaError) as caught:
        Monitor(parse(text), step=0.1, samples=101)
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize(("step", "samples"), [(0.0, 3), (-1.0, 3), (float("nan"), 3), (1.0, 0), (1.0, 2.5)])
def test_impossible_grids_are_errors(step: float, samples: Any) -> None:
    with pytest.raises(SpecError, match=r"step: expected|samples: expected a whole number"):
        Monitor(parse("x <= 3"), step, samples)


@pytest.mark.parametrize("step", [0.1, 0.01, 1 / 3, 1 / 7, 0.05, 1e-3])
def test_bounds_are_counted_in_steps_without_rounding_errors(step: float) -> None:
    x = [1.0] * 13 + [-1.0] + [1.0] * 5
    window = f"[{12 * step!r},{13 * step!r}]"
    assert judge(f"G{window} (x >= 0)", trajectory(step, x=x))[0] == -1.0
    assert judge(f"G[0,{12 * step!r}] (x >= 0)", trajectory(step, x=x))[0] == 1.0


# -- what cannot be judged -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("t", "message"),
    [
        (trajectory(x=[1.0, float("nan"), 1.0]), "'x' is nan at 1 s"),
        (trajectory(x=[1.0, 1.0, float("-inf")]), "'x' is -inf at 2 s"),
        (trajectory(x=[1.0, 1.0]), "2 recorded times up to 1 s, expected 3 up to 2 s"),
        (trajectory(y=[1.0, 1.0, 1.0]), "no signal 'x'"),
        (trajectory(0.5, x=[1.0, 1.0, 1.0]), "up to 1 s, expected 3 up to 2 s, one every 1 s"),
    ],
)
def test_bad_trajectories_are_errors_and_never_a_number(t: Trajectory, message: str) -> None:
    monitor = Monitor(parse("G[0,1] (x <= 3)"), 1.0, 3)
    for ask in (monitor.evaluate, monitor.diagnose, monitor.extremes, monitor.course):
        with pytest.raises(MonitorError, match=message):
            ask(t)


def test_a_verdict_holds_no_nan_of_a_signal_that_the_formula_does_not_name() -> None:
    t = trajectory(x=[1.0, 2.0], y=[1.0, float("nan")])
    assert judge("G (x >= 0)", t) == (1.0, 0.0)
    with pytest.raises(MonitorError, match="'y' is nan at 1 s"):
        judge("G (x <= 3)", t)


@pytest.mark.parametrize(
    "text", ["sqrt(x) <= 3", "G (1/(x - 1) <= 3)", "log(x - 1) <= 3", "exp(1000*x) >= 3"]
)
def test_predicates_outside_their_domain_are_errors(text: str) -> None:
    t = trajectory(x=[-1.0 if "sqrt" in text else 1.0] * 3)
    with pytest.raises(MonitorError, match=r"no finite value at 0 s, where .* where a condition .* x/max\(y"):
        Monitor(parse(text), 1.0, 3).evaluate(t)


def test_between_two_places_a_predicate_may_have_no_value() -> None:
    formula = parse("F[0,1] (1/x >= 1) and (y U[0,1] (1/x >= 1)) and G[3,4] (1/x >= 1)")
    monitor, y = Monitor(formula, 1.0, 5), [1.0] * 5
    t = trajectory(x=[1.0, 1.0, 0.0, 0.5, 1.0], y=y)
    assert monitor.evaluate(t).robustness == 1e-300
    assert monitor.batch({name: column[None] for name, column in t.columns.items()}).tolist() == [1e-300]
    with pytest.raises(MonitorError, match="no finite value at 4 s"):
        monitor.evaluate(trajectory(x=[1.0, 1.0, 1.0, 1.0, 0.0], y=y))


# -- sub-formulas, batches, other kinds of columns -----------------------------------------------------------


@pytest.mark.parametrize("seed", range(60))
def test_courses_agree_with_the_direct_definition(seed: int) -> None:
    formula, short = random_case(20_000 + seed, depth=3)
    t = random_trajectory(random.Random(seed), len(short) + 8)
    monitor = Monitor(formula, STEP, len(t))
    direct = Direct(t.columns, STEP)
    for part in {formula, *formula.children}:
        course = monitor.course(t, part)
        assert len(course) == len(t) - round(part.horizon(STEP) / STEP)
        assert course.tolist() == [direct.judge(part, k)[0] for k in range(len(course))], str(part)


@pytest.mark.parametrize("part", ["G[0,5] (x <= 1)", "X X X (x <= 1)"])
def test_a_part_that_needs_more_samples_has_no_course(part: str) -> None:
    with pytest.raises(FormulaError, match="needs values up to"):
        Monitor(parse("x <= 1"), 1.0, 3).course(trajectory(x=[0.0, 1.0, 2.0]), parse(part))


def test_conditions_disjuncts_and_predicates_are_watched_where_they_count() -> None:
    monitor = Monitor(parse("G[0,2] (x >= 3 -> (y <= 1 or x <= 9))"), step=1.0, samples=4)
    parts = [(str(formula), str(part.formula)) for formula, part in monitor.watched]
    assert parts == [
        ("x >= 3 -> (y <= 1 or x <= 9)", "x >= 3"),
        ("x >= 3", "x >= 3"),
        ("y <= 1 or x <= 9", "y <= 1"),
        ("y <= 1 or x <= 9", "x <= 9"),
        ("y <= 1", "y <= 1"),
        ("x <= 9", "x <= 9"),
    ]
    # The last sample is outside the window and does not count.
    columns = {"x": np.array([0.0, 2.0, 1.0, 50.0]), "y": np.array([5.0, 0.0, 0.0, -50.0])}
    found = monitor.extremes(Trajectory(np.arange(4.0), columns))
    assert found[0] == (-3.0, 0.0, -1.0, 1.0)
    assert (found[2].low, found[2].high) == (-4.0, 1.0)


@pytest.mark.parametrize(
    ("text", "extremes"),
    [
        ("x >= 5 or X (x >= 5)", (-4.0, 0.0, -4.0, 0.0)),
        ("G[0,1] (x >= 5 or F (x >= 7))", (0.5, 1.0, 2.0, 0.0)),
        ("(x >= 0) U[2,2] (x >= 8)", (-0.5, 2.0, -0.5, 2.0)),
    ],
)
def test_a_part_counts_only_when_it_is_asked(text: str, extremes: tuple[float, ...]) -> None:
    assert Monitor(parse(text), 1.0, 5).extremes(trajectory(x=[9.0, 1.0, 7.5, 7.0, 1.0]))[1] == extremes


def test_the_times_of_extremes_are_in_seconds() -> None:
    monitor = Monitor(parse("G (x >= 5 or x <= 0)"), 0.5, 5)
    assert (-4.0, 0.5, 3.0, 1.5) in monitor.extremes(trajectory(0.5, x=[6.0, 1.0, 7.0, 8.0, 7.0]))


def test_exactly_on_the_limit_the_sign_of_zero_decides() -> None:
    found = [Monitor(parse(f"x {c} 5"), 1.0, 1).evaluate(trajectory(x=[5.0])) for c in (">=", ">")]
    assert [v.violated for v in found] == [False, True]


def test_a_batch_is_judged_like_its_trajectories() -> None:
    rng = random.Random(5)
    for seed in range(30_000, 30_040):
        formula, t = random_case(seed)
        monitor = Monitor(formula, STEP, len(t))
        many = [random_trajectory(rng, len(t)) for _ in range(7)]
        columns = {name: np.stack([one[name] for one in many]) for name in t.names}
        assert monitor.batch(columns).tolist() == [monitor.evaluate(one).robustness for one in many]


def test_what_a_batch_cannot_judge_is_named() -> None:
    monitor = Monitor(parse("sqrt(x) + y <= 3"), 1.0, 3)
    x, y = np.ones((4, 3)), np.ones((4, 3))
    assert monitor.batch({"x": x, "y": y}).tolist() == [1.0] * 4
    with pytest.raises(MonitorError, match="no signal 'y'"):
        monitor.batch({"x": x})
    with pytest.raises(MonitorError, match=r"shape \(m, 3\)"):
        monitor.batch({"x": x, "y": np.ones((3, 3))})
    with pytest.raises(MonitorError, match=r"shape \(m, 3\), got \[\(\)\]"):
        monitor.batch(dict.fromkeys("xy", 1.0))  # type: ignore[arg-type]
    y[2, 1] = np.nan
    with pytest.raises(MonitorError, match="trajectory 2: signal 'y' is nan at 1 s"):
        monitor.batch({"x": x, "y": y})
    with pytest.raises(MonitorError, match=r"trajectory 3: .* no finite value at 0 s"):
        monitor.batch({"x": np.array([[1.0] * 3] * 3 + [[-1.0] * 3]), "y": np.ones((4, 3))})


def test_columns_may_be_booleans_integers_or_strided() -> None:
    matrix = np.array([[1.0, 9.0], [2.0, 9.0], [5.0, 9.0]])
    columns = {"b": np.array([True, False, True]), "i": np.array([1, 2, 3]), "x": matrix[:, 0]}
    t = Trajectory(np.arange(3.0), columns)
    verdict = Monitor(parse("G (b or i <= 3) and F (x >= 5)"), 1.0, 3).evaluate(t)
    assert verdict.robustness == ON_LIMIT
    assert verdict.values == {"b": 1.0, "i": 3.0, "x": 5.0}
    assert {type(v) for v in verdict.values.values()} == {float}
    small = Trajectory(np.arange(2.0), {"n": np.array([3, 2], dtype=np.uint8)})
    (difference,) = parse("n - 5 <= 0").expressions
    assert difference.evaluate(small.columns).tolist() == [-2.0, -3.0]


# -- monitors as values --------------------------------------------------------------------------------------


def test_monitors_are_equal_hashable_and_travel() -> None:
    monitor = Monitor(parse("G[0,2] (x <= 3)"), step=1.0, samples=5)
    again = pickle.loads(pickle.dumps(monitor))
    assert again == monitor
    assert hash(again) == hash(monitor)
    assert monitor != Monitor(monitor.formula, step=1.0, samples=6)
    assert again.evaluate(trajectory(x=X)) == monitor.evaluate(trajectory(x=X))


def test_one_monitor_serves_many_threads() -> None:
    monitor = Monitor(parse("G[0,900] (x <= 0) and F (x >= 1)"), 1.0, 1000)
    trajectories = [trajectory(x=[float(i)] * 1000) for i in range(40)]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(monitor.evaluate, trajectories * 5))
    assert [v.robustness for v in found] == [min(-float(i), i - 1.0) for i in range(40)] * 5
