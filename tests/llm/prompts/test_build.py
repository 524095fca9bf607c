"""What is told, as values; how it reads is test_render.py's."""

from dataclasses import replace

import pytest

from falsifier.core.space import Freedom, InputRange
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.prompts import VARIANTS, Prompt, View, build_prompt, render
from falsifier.llm.prompts.blocks import SampleLines
from falsifier.llm.prompts.circumstances import Circumstances
from falsifier.testing import FREE, START, lag_problem

PROBLEM = lag_problem(free=FREE, parameters=[START])
SAMPLE = evaluate(PROBLEM, PROBLEM.space.decode([0.5, 0.5, 1.0, 1.0, 0.25]))
PARTS = {"system", "requirement", "outputs", "advice"}


def built(variant: str, *evaluations: Evaluation, **more: object) -> Prompt:
    return build_prompt(View.of(PROBLEM), VARIANTS[variant], evaluations, **more)  # type: ignore[arg-type]


def sample(variant: str) -> SampleLines:
    history = built(variant, SAMPLE).history
    assert history is not None
    (only,) = history.samples
    return only


@pytest.mark.parametrize(
    ("variant", "parts"),
    [
        ("MP1", {"advice"}),
        ("MP2", {"requirement", "outputs", "advice"}),
        ("MP3", {"requirement", "outputs", "advice"}),
        ("MP4", {"requirement", "outputs", "advice"}),
        ("MP5", PARTS),
    ],
)
def test_a_variant_leaves_whole_blocks_out(variant: str, parts: set[str]) -> None:
    prompt = built(variant)
    assert {name for name in PARTS if getattr(prompt, name) is not None} == parts
    assert prompt.task.knows_requirement == ("requirement" in parts)
    assert prompt.history is None


def test_numbers_are_told_with_their_meaning_from_the_second_variant_on() -> None:
    meanings = {name: [d.meaning for d in built(name).inputs.dimensions] for name in ("MP1", "MP2")}
    assert meanings["MP1"] == [""] * 5
    assert meanings["MP2"][1] == "u at t = 3.3 s" and meanings["MP2"][4] == "x0"
    assert [(d.low, d.high) for d in built("MP1").inputs.dimensions] == [("-1", "1")] * 5


def test_the_default_variant_tells_signals_and_parameters_with_all_that_is_known() -> None:
    inputs = built("MP5").inputs
    assert inputs.dimensions == ()
    (u,), (x0,) = inputs.inputs, inputs.parameters
    assert (u.name, u.unit, u.description, u.control_points) == ("u", "V", "drive", 4)
    assert u.times == ("0", "3.333333", "6.666667", "10")
    assert (u.max_control_points, u.min_interval) == (100, 0.1)
    assert (x0.low, x0.high, x0.nominal) == ("-1", "1", "0")


def test_many_control_points_are_told_by_their_first_and_last_times() -> None:
    space = replace(PROBLEM.space, inputs=(InputRange("u", -1.0, 1.0, control_points=101),))
    prompt = build_prompt(View.of(replace(PROBLEM, space=space)), VARIANTS["MP5"], [])
    (u,) = prompt.inputs.inputs
    assert u.times == ("0", "0.1", "0.2", "...", "10")


@pytest.mark.parametrize(("variant", "facts"), [("MP1", 0), ("MP2", 0), ("MP3", 1), ("MP4", 2)])
def test_published_variants_tell_one_more_fact_each(variant: str, facts: int) -> None:
    told = sample(variant)
    assert (len(told.facts), told.details) == (facts, ())
    assert told.robustness == f"{SAMPLE.robustness:.3f}"


def test_the_default_variant_tells_details_that_may_be_left_out() -> None:
    told = sample("MP5")
    assert told.facts and told.details
    assert told.inputs[1] == "x0 = 0.25"


def test_a_failed_sample_is_told_with_its_reason_by_the_default_variant_only() -> None:
    failed = replace(SAMPLE, status="crashed", verdict=None, trajectory=None, reason="division by zero")
    history = built("MP5", failed).history
    assert history is not None
    assert "crashed: division by zero" in history.samples[0].failure
    assert history.samples[0].robustness == ""
    assert built("MP4", failed).history is None


def test_what_is_not_shown_is_counted() -> None:
    history = built("MP5", *[SAMPLE] * 14).history
    assert history is not None
    assert (len(history.samples), history.omitted) == (12, 2)


def test_pending_candidates_and_notes_are_told_even_without_samples() -> None:
    history = built("MP5", pending=[SAMPLE.candidate], notes=["a note"]).history
    assert history is not None
    assert history.samples == ()
    assert len(history.pending) == 1 and "x0 = 0.25" in history.pending[0]
    assert history.notes == ("a note",)


def test_a_flat_robustness_is_noted_once_there_are_two_samples() -> None:
    flat, other = built("MP5", SAMPLE, SAMPLE).history, built("MP5", SAMPLE).history
    assert flat is not None and other is not None
    assert (len(flat.notes), other.notes) == (1, ())


def test_freedom_is_told_as_far_as_it_goes() -> None:
    problem = lag_problem(free=Freedom(7, 0.5))
    (u,) = build_prompt(View.of(problem), VARIANTS["MP5"], []).inputs.inputs
    assert (u.max_control_points, u.min_interval) == (7, 0.5)
    (fixed,) = build_prompt(View.of(lag_problem()), VARIANTS["MP5"], []).inputs.inputs
    assert fixed.max_control_points is None


def test_start_budget_and_doubts_are_told_by_mp5() -> None:
    sample = evaluate(PROBLEM, PROBLEM.space.decode([0.5] * 4 + [0.25]))
    circumstances = Circumstances(30, {"x": (0.0, 0.0)}, {sample.candidate.key: "does not count"})
    prompt = build_prompt(View.of(PROBLEM), VARIANTS["MP5"], [sample], circumstances=circumstances)
    assert prompt.outputs is not None and prompt.history is not None
    assert [signal.start for signal in prompt.outputs.signals] == ["0"]
    assert prompt.history.samples[0].doubt == "does not count"
    _, changing = render(prompt)
    assert "1 of 30 simulations spent, 29 left." in changing.content
    _, first = render(build_prompt(View.of(PROBLEM), VARIANTS["MP5"], [], circumstances=circumstances))
    assert first.content == (
        "Nothing has been simulated yet; 30 simulations may be spent. Propose the first sample."
    )
    depends = replace(circumstances, start={"x": (-0.5, 0.5)})
    outputs = build_prompt(View.of(PROBLEM), VARIANTS["MP5"], [], circumstances=depends).outputs
    assert outputs is not None
    assert outputs.signals[0].start == "-0.5 to 0.5, depending on what you choose"


def test_the_published_variants_tell_neither_start_nor_budget_but_what_does_not_count() -> None:
    sample = evaluate(PROBLEM, PROBLEM.space.decode([0.5] * 4 + [0.25]))
    circumstances = Circumstances(30, {"x": (0.0, 0.0)}, {sample.candidate.key: "does not count"})
    for name in ("MP1", "MP2", "MP3", "MP4"):
        prompt = build_prompt(View.of(PROBLEM), VARIANTS[name], [sample], circumstances=circumstances)
        text = "\n".join(m.content for m in render(prompt))
        assert "30 simulations" not in text and "at t = 0:" not in text
        assert "does not count" in text


@pytest.mark.parametrize(
    ("formula", "told"),
    [
        ("G[0,4] F[0,1.5] (x <= 1)", "from 0 to 10 s; the requirement looks only at 0 to 5.5 s."),
        ("G[0,10] (x <= 1)", "from 0 to 10 s.\n"),
        ("G (x <= 1)", "from 0 to 10 s.\n"),
    ],
)
def test_the_part_of_the_simulation_that_matters_is_told(formula: str, told: str) -> None:
    prompt = build_prompt(View.of(lag_problem(formula)), VARIANTS["MP5"], [])
    assert f"The simulation runs {told}" in render(prompt)[0].content
