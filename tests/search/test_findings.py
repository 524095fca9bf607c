from dataclasses import replace

from falsifier.core.space import InputRange
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.search.findings import Finding, failures, inexpressible
from falsifier.search.refine_levels import (
    RefineLevel,
    searched_space,
)
from falsifier.testing import FREE, lag_problem
from tests.fmu.fixtures import path as fmu_path


def test_only_findings_about_the_requirement_make_an_answer_vacuous() -> None:
    assert Finding(kind="condition", text="").vacuous
    assert not Finding(kind="parameterization", text="").vacuous


def test_a_wide_margin_is_no_part_that_was_not_tested() -> None:
    assert Finding(kind="condition", text="").untested
    assert not Finding(kind="threshold", text="").untested


def test_failures_that_differ_only_in_numbers_have_one_cause() -> None:
    found = failures(
        [
            (2, "m: index 0 is outside of 1..5 at t = 1.25s"),
            (4, "m: car2 diverged at 0x7f01"),
            (5, "m: index -3 is outside of 1..5 at t = 2e-3s"),
            (6, "m: car3 diverged at 0x7f02"),
            (8, "m: index 17 is outside of 1..5 at t = 4s"),
        ]
    )
    assert [(f.count, f.simulation) for f in found] == [(3, 2), (1, 4), (1, 6)]
    assert found[0].text == (
        "3 simulations failed: m: index 0 is outside of 1..5 at t = 1.25s (for example simulation 3)"
    )
    assert found[1].text == "simulation 5 failed: m: car2 diverged at 0x7f01"


def told(problem: Problem, engine: str = "surrogate") -> str:
    finding = inexpressible(problem, [RefineLevel(0, searched_space(problem.space, engine, None))], 20)
    return finding.text if finding else ""


def test_what_a_fixed_space_cannot_express_is_told_with_the_option_that_widens_it() -> None:
    formula = "G[0,9] (F[0,1] (y <= 1))"
    stated = Problem.from_fmu(fmu_path("Lag_2"), formula, inputs={"u": (-1, 1, 5)}, stop_time=10.0)
    assert told(stated) == (
        "Faster inputs were not tried: u had 5 control points (pchip) and needed 2.5 s from -1 to 1. The "
        "formula's smallest window is 1 s. To try them: falsifier run ... --refine (slow inputs first, then "
        "faster ones), or --search u=-1:1 without a number of control points."
    )
    assert told(replace(stated, source=None)).endswith(
        "falsify(..., refine=True), or InputRange(..., free=Freedom(200, 0.05))."
    )


def test_the_remedy_depends_on_why_the_space_was_fixed() -> None:
    free = lag_problem(free=FREE)
    assert not told(free)
    assert "--engine surrogate" in told(free, "cma")
    fixed = load_problem("AT1", parameterization="fixed")
    assert "--parameterization free" in told(fixed)


def test_constant_and_held_inputs_are_described_as_such() -> None:
    problem = lag_problem()
    u = problem.space.inputs[0]

    def text(changed: InputRange) -> str:
        return told(replace(problem, space=replace(problem.space, inputs=(changed,))))

    assert "u was constant" in text(replace(u, control_points=1))
    assert "u had 4 held pieces of 2.5 s" in text(replace(u, interpolation="constant"))


def test_as_many_control_points_as_make_sense_leave_nothing_out() -> None:
    assert not told(lag_problem(points=100))
