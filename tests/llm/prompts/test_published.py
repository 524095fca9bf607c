from dataclasses import replace

import pytest

from falsifier.core.ranges import ParameterRange
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.requirement import Requirement
from falsifier.stl import parse
from falsifier.testing import lag_problem
from tests.llm.prompts.support import told, transmission


def test_published_variants_tell_the_ten_most_recent_in_order() -> None:
    problem = lag_problem()
    evaluations = [evaluate(problem, problem.space.decode([0.05 * i] * 4)) for i in range(14)]
    evaluations[12] = replace(evaluations[12], verdict=None, status="failed", reason="diverged")
    _, changing = told(problem, "MP4", evaluations)
    samples = [line for line in changing.splitlines() if line.startswith("Sample ")]
    values = [0.05 * i for i in (3, 4, 5, 6, 7, 8, 9, 10, 11, 13)]
    assert samples == [
        f"Sample {n}: u = [{', '.join([f'{round(v, 3):g}'] * 4)}]" for n, v in enumerate(values, start=1)
    ]
    assert "13" not in changing
    assert "diverged" not in changing


def test_mp1_is_numbers_and_robustness() -> None:
    problem, evaluation = transmission()
    standing, changing = told(problem, "MP1", [evaluation])
    ranges = "\n".join(f"{i}, from 0 to {100 if i < 8 else 325}" for i in range(1, 11))
    assert standing == (
        "Your task is to find values with which a system violates its specification. Each sample is judged "
        "by a number, its robustness: lower is better, and below 0 the specification is violated.\n\n"
        f"You choose 10 numbers.\n{ranges}\n\n"
        "Consider which combinations of values had the lower robustness.\n"
        "Consider what each number may stand for and how it may act on the system.\n\n"
        "Reply with one JSON object in this form, with one or two sentences of rationale:\n"
        '{"rationale": "why these values", "point": [10 numbers]}'
    )
    assert changing == (
        "Samples so far, in the order in which they were simulated:\n\n"
        "Sample 1: point = [100, 100, 100, 0, 0, 0, 0, 0, 0, 0]\n  robustness 0.419\n\n"
        "Propose the next sample. Do not repeat an earlier one."
    )


def test_mp2_adds_formula_meanings_courses_and_guidance_on_the_requirement() -> None:
    problem, evaluation = transmission()
    standing, changing = told(problem, "MP2", [evaluation])
    _, requirement, outputs, inputs, guidance, reply = standing.split("\n\n")
    assert requirement.splitlines()[1:] == ["G[0,20] (speed <= 120)"]
    assert outputs == "Output signals: speed"
    assert inputs.splitlines()[2] == "2: throttle at t = 8.3 s, from 0 to 100"
    assert inputs.splitlines()[11:] == [
        f"{name} between these times: pchip (monotone cubic) interpolation, sampled and held every 0.05 s"
        for name in ("throttle", "brake")
    ]
    assert "what the requirement demands" in guidance and "output values" not in guidance
    assert '"values": [7 numbers]' in reply
    (sample,) = (part for part in changing.split("\n\n") if part.startswith("Sample 1:"))
    assert sample.splitlines() == [
        "Sample 1: throttle = [100, 100, 100, 0, 0, 0, 0]; brake = [0, 0, 0]",
        "  robustness 0.419",
    ]


def test_mp3_adds_output_values_and_mp4_what_decided() -> None:
    problem, evaluation = transmission()
    values = (
        "  speed: 0.0 at 0.0 s, 82.5 at 8.3 s, 112.5 at 16.7 s, 115.3 at 25.0 s, 101.8 at 33.3 s, "
        "90.7 at 41.7 s, 81.5 at 50.0 s"
    )
    decided = "  the robustness was decided at t = 20.0 s with speed = 119.6"
    for variant, facts in (("MP3", [values]), ("MP4", [values, decided])):
        standing, changing = told(problem, variant, [evaluation])
        assert changing.split("\n\n")[1].splitlines()[2:] == facts
        assert "output values of the samples" in standing


@pytest.mark.parametrize("variant", ["MP1", "MP2", "MP3", "MP4"])
def test_nothing_of_the_default_variant_is_told(variant: str) -> None:
    problem, evaluation = transmission("AT6a")
    start = {"speed": (0.0, 0.0)}
    text = "\n".join(told(problem, variant, [evaluation] * 2, start=start, simulations=30))
    for word in ("mph", "Car with", "50 s", "simulations", "30 ", "In words", "exactly 0", "limits", "switch",
                 "implication", "flat", "gear", "strategy", "why:", "Alternatively"):  # fmt: skip
        assert word not in text, word


def test_digits_are_the_published_ones() -> None:
    problem = lag_problem("G[0,9] (x <= 1e-5)", parameters=[ParameterRange("x0", 0.0, 1e-4)])
    evaluation = evaluate(problem, problem.space.decode([1 / 3, 0, 0, 0, 2.3456e-5]))
    trajectory = evaluation.trajectory
    assert trajectory is not None and evaluation.verdict is not None
    tiny = replace(trajectory, columns={**trajectory.columns, "x": 1e-3 * trajectory["x"]})
    changed = replace(evaluation, trajectory=tiny, verdict=replace(evaluation.verdict, critical_time=5.0))
    _, changing = told(problem, "MP4", [changed])
    assert "u = [0.333, 0, 0, 0]; x0 = 2e-05" in changing, "more than three decimals in a narrow range"
    assert "x: 0.000 at 0.0 s, " in changing, (
        "a value that is not zero does not read as zero with one decimal"
    )


@pytest.mark.parametrize(("formula", "time"), [("G[0,9] (x <= 2)", "0.5"), ("F[0,0.25] (x <= 2)", "0.46")])
def test_a_critical_time_has_the_decimals_of_the_times_in_the_formula(formula: str, time: str) -> None:
    problem = lag_problem()
    evaluation = evaluate(problem, problem.space.decode([0, 1, 0, 1]))
    assert evaluation.verdict is not None
    other = replace(problem, requirement=Requirement("R", parse(formula)))
    decided = replace(evaluation, verdict=replace(evaluation.verdict, critical_time=0.456))
    assert f"decided at t = {time} s with x = " in told(other, "MP4", [decided])[1]
