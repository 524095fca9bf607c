from dataclasses import replace

from falsifier.core.candidate import Candidate
from falsifier.engines import make_engine
from falsifier.evaluation.evaluate import Evaluation
from falsifier.stl import Verdict
from falsifier.testing import START, drive, lag_problem, simulated
from tests.engines.support import NamedEngine


class TestContract(NamedEngine):
    engine = "corners"


def test_corners_come_first_and_each_once() -> None:
    problem = lag_problem(inputs=2, parameters=[START])
    engine = make_engine("corners", problem, seed=1)
    asked = drive(engine, simulated(problem, lambda x: float(3 - x.max())), rounds=9)
    corners = {(*(s.values for s in c.signals.values()), *c.parameters.values()) for c in asked[:8]}
    assert len(corners) == 8
    assert all(abs(v) == 1.0 for c in asked[:8] for s in c.signals.values() for v in s.values)
    assert any(abs(v) != 1.0 for s in asked[8].signals.values() for v in s.values)


def test_an_input_without_effect_costs_one_simulation() -> None:
    problem = lag_problem(inputs=3)
    engine = make_engine("corners", problem, seed=0)

    def judge(candidate: Candidate) -> Evaluation:
        u, _, w = (candidate.signals[name].values[0] for name in "uvw")
        return Evaluation(candidate, verdict=Verdict(3.0 - u - w, 0.0, "u + w <= 3"))

    asked = drive(engine, judge, rounds=4)
    assert min(judge(c).robustness or 0.0 for c in asked) == 1.0


def test_what_has_a_single_value_has_one_extreme() -> None:
    problem = lag_problem(inputs=2)
    u, v = problem.space.inputs
    problem = replace(problem, space=replace(problem.space, inputs=(replace(u, low=0.5, high=0.5), v)))
    first, second, third = make_engine("corners", problem, seed=0).ask(3)
    assert {first.rationale, second.rationale} == {"constant extremes: v low", "constant extremes: v high"}
    assert third.rationale == "uniform random: all corners were tried"
    assert first.signals["u"].values == second.signals["u"].values


def test_its_reason_names_the_levels() -> None:
    (candidate,) = make_engine("corners", lag_problem(inputs=2), seed=0).ask()
    levels = {name: "high" if s.values[0] > 0 else "low" for name, s in candidate.signals.items()}
    assert candidate.rationale == f"constant extremes: u {levels['u']}, v {levels['v']}"
