from dataclasses import replace

from falsifier.core.space import InputRange
from falsifier.evaluation.evaluate import evaluate
from falsifier.llm.prompts.advice import advice
from falsifier.llm.prompts.variants import VARIANTS
from falsifier.llm.prompts.view import View
from falsifier.problem.loading import load_problem
from falsifier.testing import FREE, lag_problem
from tests.llm.prompts.support import told


def lines(variant: str, formula: str = "G[0,10] (x <= 0.9)", *, free: bool = False) -> list[str]:
    view = View.of(lag_problem(formula, free=FREE if free else None))
    found = advice(view, VARIANTS[variant])
    return [*found.on_samples, *found.lines]


def test_each_variant_adds_what_it_tells_something_of() -> None:
    assert [len(lines(name)) for name in ("MP1", "MP2", "MP3", "MP4")] == [2, 2, 3, 3]
    assert lines("MP4") == lines("MP3") and lines("MP3")[:2] == lines("MP2")
    assert not set(lines("MP5")) & set(lines("MP4"))


def test_advice_on_samples_waits_for_the_first() -> None:
    found = advice(View.of(lag_problem()), VARIANTS["MP5"])
    assert "earlier samples" in found.on_samples[0]
    assert not any("sample" in line for line in found.lines if "first samples" not in line)


def test_where_robustness_is_flat_what_decided_it_gives_no_direction() -> None:
    problem = lag_problem("G[0,10] (x <= 0.9)")
    one = evaluate(problem, problem.space.decode([0.0] * 4))
    other = evaluate(problem, problem.space.decode([0.5] * 4))
    for second, is_flat in ((one, True), (other, False)):
        _, changing = told(problem, "MP5", [one, second])
        assert ("The robustness is flat" in changing) is is_flat
        assert ("Look at the time that decided" in changing) is not is_flat


def test_any_conjunct_is_enough_where_there_are_some() -> None:
    several = ("G[0,9] (x <= 0.9) and G[0,9] (x >= -0.9)", "G[0,9] (x <= 0.9 and x >= -0.9)")
    one = ("G[0,9] (x <= 0.9)", "F[0,9] (x <= 0.9 and x >= -0.9)", "G[0,9] (x <= 0.9 or x >= 0.5)")
    assert [any("any one of its conjuncts" in a for a in lines("MP5", f)) for f in several] == [True] * 2
    assert [any("any one of its conjuncts" in a for a in lines("MP5", f)) for f in one] == [False] * 3
    assert not any("conjunct" in a for a in lines("MP4", several[0]))


def test_parameters_alone_get_no_advice_on_signals() -> None:
    text = " ".join((*advice(View.of(load_problem("F16")), VARIANTS["MP5"]).lines,))
    assert "switch" not in text and "input" not in text


def test_advice_on_shapes_is_given_where_shapes_may_be_chosen() -> None:
    (shape,) = set(lines("MP5", free=True)) - set(lines("MP5"))
    assert "pulses" in shape
    assert lines("MP4", free=True) == lines("MP4")


def test_advice_on_conditions_is_given_where_there_is_one() -> None:
    (condition,) = (
        set(lines("MP5", "G[0,10] (u >= 0.5 -> x <= 0.9)"))
        - set(lines("MP5"))
        - set(lines("MP5", "G[0,10] (u >= 0.5 and x <= 0.9)"))
    )
    assert "condition" in condition


def test_units_are_spoken_of_where_they_differ() -> None:
    one = advice(View.of(load_problem("AT1")), VARIANTS["MP5"]).lines
    several = advice(View.of(load_problem("AT6a")), VARIANTS["MP5"]).lines
    assert any("unit" in line for line in several)
    assert not any("unit" in line for line in one)


def test_inputs_that_only_jump_get_advice_on_order_and_times() -> None:
    problem = lag_problem(inputs=2, free=FREE)
    u, v = problem.space.inputs
    mode = replace(v, low=0.0, high=1.0, kind="boolean", interpolation="constant")

    def told(*inputs: InputRange) -> str:
        space = replace(problem.space, inputs=inputs)
        return " ".join(advice(View.of(replace(problem, space=space)), VARIANTS["MP5"]).lines)

    assert "slow changes" in told(u, mode) and "v can only jump" in told(u, mode)
    only = told(mode)
    assert "slow" not in only and "limits" not in only and "One value throughout" in only
