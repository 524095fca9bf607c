"""What changes from question to question: samples as they were told first, and what is new."""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.ranges import Freedom, InputRange, ParameterRange
from falsifier.core.signals import Interpolation, Signal
from falsifier.core.space import SearchSpace
from falsifier.core.trajectory import Trajectory
from falsifier.errors import ChatError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.messages import Message
from falsifier.llm.prompts import VARIANTS, Questions, View
from falsifier.llm.prompts.reached import Reached, SampleProgress
from falsifier.llm.prompts.tried import Tried
from falsifier.llm.usage import count_tokens
from falsifier.problem.problem import Problem
from falsifier.stl import Verdict
from falsifier.testing import FREE, START, lag_problem
from tests.llm.prompts.support import told, transmission

PROBLEM = lag_problem(free=FREE, parameters=[START])


def sampled(problem: Problem, *points: Sequence[float]) -> list[Evaluation]:
    return [evaluate(problem, problem.space.decode(point)) for point in points]


def switch_and_counter() -> View:
    """A view of a Boolean x and an integer n."""
    view = View.of(lag_problem("G[0,10] (x <= 0.9)"))
    kinds = (Variable("x", kind="boolean"), Variable("n", kind="integer"))
    experiment = replace(view.experiment, outputs=("x", "n"))
    return replace(view, info=ModelInfo("m", variables=kinds), experiment=experiment)


def asked_each(problem: Problem, evaluations: Sequence[Evaluation]) -> list[Message]:
    """The changing part of the question after each sample."""
    questions = Questions(View.of(problem), VARIANTS["MP5"])
    found = []
    for evaluation in evaluations:
        questions.tell(evaluation)
        found.append(questions.ask()[1])
    return found


@pytest.mark.parametrize("variant", VARIANTS)
def test_an_empty_history_is_not_described(variant: str) -> None:
    _, changing = told(transmission()[0], variant)
    assert changing.endswith("Propose the first sample.") and "amples so far" not in changing
    assert ("good first samples" in changing) == (variant in ("MP5", "MP6"))
    _, once = told(lag_problem(points=1), variant)
    assert "steps" not in once, "there is one value for the whole time"
    texts = "\n".join(told(transmission()[0], variant, transmission()[1:]))
    assert "first samples" not in texts and ("Look at the times" in texts) == (variant in ("MP5", "MP6"))


def test_a_question_begins_with_the_one_before_it() -> None:
    rng = np.random.default_rng(1)
    messages = asked_each(PROBLEM, sampled(PROBLEM, *rng.uniform(-1, 1, (12, 5))))
    for before, after in pairwise(messages):
        assert after.content.startswith(before.content[: before.stable])
        assert 0 < before.stable < after.stable < len(after.content)


def test_a_long_history_is_shortened_rarely_and_keeps_what_matters() -> None:
    problem = transmission("AT51")[0]
    rng = np.random.default_rng(2)
    low, high = problem.space.bounds.T
    evaluations = sampled(problem, *(low + rng.random((24, len(low))) * (high - low)))
    questions = Questions(View.of(problem), VARIANTS["MP5"])
    kept, before = [], ""
    for evaluation in evaluations:
        questions.tell(evaluation, why="to see what it does")
        messages = questions.ask()
        assert sum(count_tokens(m.content) for m in messages) <= 6000
        kept.append(messages[1].content.startswith(before))
        before = messages[1].content[: messages[1].stable]
    assert kept.count(False) <= len(kept) // 3
    text = messages[1].content
    assert all(f"Sample {n}: throttle: pchip, 7 evenly spaced values [" in text for n in range(1, 25))
    assert "the first to reach: speed " in text


def test_what_does_not_fit_is_left_out_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("falsifier.llm.prompts.question.MOST_PROMPT_TOKENS", 1900)
    rng = np.random.default_rng(3)
    last = asked_each(PROBLEM, sampled(PROBLEM, *rng.uniform(-1, 1, (40, 5))))[-1].content
    assert " of 40, in the order in which" in last and "Sample 40: " in last
    monkeypatch.setattr("falsifier.llm.prompts.question.MOST_PROMPT_TOKENS", 100)
    with pytest.raises(ChatError, match=r"needs \d+ tokens without any history, but the limit is 100"):
        Questions(View.of(PROBLEM), VARIANTS["MP5"]).ask()


def test_the_latest_sample_is_told_in_full_beyond_the_usual_length(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("falsifier.llm.prompts.question.USUAL_PROMPT_TOKENS", 1200)
    rng = np.random.default_rng(3)
    last = asked_each(PROBLEM, sampled(PROBLEM, *rng.uniform(-1, 1, (40, 5))))[-1].content
    assert (
        " of 40, in the order in which" in last
        and "More of sample 40:\n" in last
        and "\n  x around t = " in last
    )


def test_the_rest_of_the_latest_sample_has_all_signals_whose_names_begin_alike() -> None:
    view, t = View.of(lag_problem("G[0,10] (x <= 9)")), np.linspace(0.0, 10.0, 101)
    known = tuple(Variable(name) for name in ("x", "a:b", "a:c"))
    grid = replace(view.experiment, outputs=("x", "a:b", "a:c"))
    questions = Questions(
        replace(view, info=ModelInfo("m", variables=known), experiment=grid), VARIANTS["MP5"]
    )
    made = Trajectory(t, {"x": 0.1 * np.sin(t), "u": 0 * t, "a:b": np.sign(np.sin(t)), "a:c": np.exp(-t)})
    evaluation = Evaluation(PROBLEM.space.decode([0.0] * 5), "ok", Verdict(9.0, 1.0, "x <= 9"), "", made)
    for _ in range(2):
        questions.tell(evaluation)
    assert "\n  a:c: 0:1 " in questions.ask()[1].content.partition("More of sample 2:")[2]


def test_the_best_of_all_samples_are_named_and_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("falsifier.llm.prompts.question.MOST_PROMPT_TOKENS", 2600)
    evaluations = sampled(PROBLEM, *np.random.default_rng(3).uniform(-1, 1, (40, 5)))
    evaluations.sort(key=lambda e: e.robustness or 0.0)
    order = [*range(10, 25), 2, 0, 1, *range(25, 40), *range(3, 10)]  # the best in the middle
    last = asked_each(PROBLEM, [evaluations[n] for n in order])[-1].content
    assert " of 40, in the order in which" in last
    assert (
        "Lowest robustness so far: -0.0397 in sample 17, -0.0305 in sample 18, +0.0247 in sample 16." in last
    )
    assert all(f"Sample {n}: " in last for n in (16, 17, 18)) and "Sample 15: " not in last


def test_what_decided_and_everything_there() -> None:
    problem, evaluation = transmission()
    _, changing = told(problem, "MP5", [evaluation])
    for part in (
        "robustness +0.418",
        "was lowest at 20 s: speed = 119.581 is below 120",
        "all signals at t = 20 s: speed = 119.581 mph, rpm = ",
        "gear: 1, then 2 from 2.56 s, 3 from 6.16 s, 4 from 12.32 s",
        "speed: 0:0 ",
        "speed around t = 20 s: ",
        "throttle: pchip, 7 evenly spaced values [100, 100, 100, 0, 0, 0, 0]",
        "brake: constant 0",
    ):
        assert part in changing, part


def test_what_few_samples_reached_counts_more_than_much_that_many_did() -> None:
    reached = Reached(View.of(PROBLEM))
    usual, rare = (
        SampleProgress(frozenset(("u", None, n) for n in stages)) for stages in ((0, 1, 2), (1, 3))
    )
    for progress in (usual, usual, usual, rare):
        reached.news(progress)
    assert reached.rank(rare) > reached.rank(usual)


def test_in_a_narrow_range_it_is_told_from_where_on_a_value_is_new() -> None:
    reached = Reached(View.of(PROBLEM))
    reached.news(SampleProgress(ranges={"x": (1e6, 1e6 + 0.004)}))
    assert reached.news(SampleProgress(ranges={"x": (1e6, 1e6 + 0.006)})) == (
        "x up to 1000000.006, before 1000000.004",
    )


def test_on_a_plateau_it_is_told_what_nothing_moved_and_what_was_not_tried() -> None:
    problem = transmission("AT51")[0]
    still, brisk = [0.0] * 7 + [325.0] * 3, [100.0] * 7 + [0.0] * 3
    _, changing = told(problem, "MP5", sampled(problem, still, brisk, [0.0] * 7 + [300.0] * 3))
    assert "flat: it was +0.5 in all 3 samples" in changing and "Look at the time" not in changing
    assert "Try something else: a short pulse" in changing, "none is the best"
    assert "the first to reach: gear 2; gear 3; gear 4; speed up to " in changing
    assert (
        "Not tried so far: throttle between 0 and 100; brake between 0 and 300. See" in changing
        and "The same in all" not in changing
    )
    assert re.search(r"^Ranges so far: speed 0 to \S+, rpm \S+ to \S+\.$", changing, re.MULTILINE)
    _, same = told(problem, "MP5", sampled(problem, still, [0.0] * 7 + [300.0] * 3))
    assert "in all 2 samples, and gear never changed, so its value gives no" in same, "told once"
    assert "The same in all" not in same
    _, other = told(PROBLEM, "MP5", sampled(PROBLEM, [0.0] * 5, [0.5] * 5))
    assert "flat" not in other and "Lowest robustness so far: +0.4 in sample 2." in other


def test_what_never_changed_is_told_once_and_which_differences_had_no_effect() -> None:
    still = lag_problem(inputs=2, response=lambda t, inputs, _: {"x": 0.1 * np.maximum(inputs["u"], 0.0)})
    _, flat = told(still, "MP5", sampled(still, *([-1.0] * 7 + [k / 9] for k in range(9))))
    assert "+0.9 in all 9 samples, and x never changed" in flat and " decided the lowest" not in flat
    assert "The same in all" not in flat and "Without effect" not in flat, "nothing moves: that says it"
    _, moving = told(still, "MP5", sampled(still, *([0, k % 3 / 2, 0, 0, 0, 0, 0, k / 9] for k in range(9))))
    assert "samples 2, 5, 8 until 10 s, though v differed from about 6.7 s on; samples 3, 6" in moving


def test_failed_samples_rationales_lessons_and_inputs_that_look_alike() -> None:
    failed = Evaluation(PROBLEM.space.decode([1] * 5), "crashed", reason="division\nby zero")
    _, only = told(PROBLEM, "MP5", [failed])
    assert "no verdict, the simulation crashed: division by zero" in only and "output values" not in only
    assert "crashed" not in told(PROBLEM, "MP4", [failed])[1]
    questions = Questions(View.of(PROBLEM), VARIANTS["MP5"])
    first, alike = sampled(PROBLEM, [0.5] * 5, [0.5 + 1e-7, 0.5, 0.5, 0.5, 0.5])
    questions.tell(first, why="a step\nup " + "and on " * 100)
    questions.tell(alike)
    text = questions.ask(lessons="x follows u")[1].content
    assert "chosen because: a step up and on" in text and text.count("and on") < 50
    assert "Your lessons so far: x follows u" in text
    assert text.count("this is sample 1 again, or differs from it by less than is shown") == 1


def test_several_candidates_pending_ones_and_the_budget() -> None:
    (sample,) = sampled(PROBLEM, [0.5] * 5)
    pending = [PROBLEM.space.decode([0.25] * 5)]
    standing, changing = told(
        PROBLEM, "MP5", [sample], count=3, pending=pending, notes=["a note"], simulations=30
    )
    assert "3 different candidates" in standing and '"candidates": [{' in standing
    assert "Proposed and not simulated so far:\nu: constant 0.25; x0 = 0.25" in changing
    assert "a note" in changing
    assert "1 of 30 simulations spent, 29 left. Propose the next 3 different samples" in changing
    assert "30 simulations may be spent" in told(PROBLEM, "MP5", simulations=30)[1]


@pytest.mark.parametrize("variant", VARIANTS)
def test_doubts_are_told_and_the_budget_by_own_variants_only(variant: str) -> None:
    questions = Questions(View.of(PROBLEM), VARIANTS[variant], start={"x": (0.0, 0.0)})
    questions.tell(*sampled(PROBLEM, [0.5] * 4 + [0.0]), doubt="does not count")
    text = "\n".join(m.content for m in questions.ask(simulations=30))
    assert "does not count" in text
    assert ("30 simulations" in text and "; probably 0 at t = 0\n" in text) == (variant in ("MP5", "MP6"))
    questions.tell(*sampled(PROBLEM, [0.5] * 5))
    assert "; probably 0 at t = 0\n" not in questions.ask()[0].content, "the sample began elsewhere"


def test_changes_of_discrete_signals_are_told_with_the_other_signals() -> None:
    still, brisk = [0.0] * 7 + [325.0] * 3, [100.0] * 7 + [0.0] * 3
    problem = transmission("AT51")[0]
    _, changing = told(problem, "MP5", sampled(problem, still, brisk, [90.0] * 7 + [0.0] * 3))
    line, again = re.findall("changes, with other signals then: (.*)", changing)
    first, *later = line.split("; ")
    assert re.fullmatch(r"gear 1 -> 2 at \S+ s \(speed \S+, rpm \S+, throttle 100, brake 0\)", first)
    assert [change.partition(" at ")[0] for change in later] == ["gear 2 -> 3", "gear 3 -> 4"]
    assert again.startswith("gear 1 -> 2 at ") and "throttle 90" in again, "the requirement names it"


def test_items_of_an_enumeration_are_named_wherever_its_values_are_told() -> None:
    problem = lag_problem("G[0,10] (x <= 0.9)")
    mode = Variable("x", kind="enumeration", literals={"Idle": 0, "Run": 1})
    view = View.of(problem)
    view = replace(view, info=ModelInfo("m", variables=(mode,)))
    assert view.labelled("other", 1.0, "1") == "1"
    assert view.labelled("x", 1.0, "1") == "1 (Run)" and view.labelled("x", 7.0, "7") == "7"
    evaluation = evaluate(problem, problem.space.decode([0] * 4))
    assert evaluation.trajectory is not None
    times = evaluation.trajectory.times
    steps = (((times >= 5) & (times < 8)) | (times >= 9)).astype(float)
    changed = replace(
        evaluation, trajectory=replace(evaluation.trajectory, columns={"x": steps, "u": 0 * steps})
    )
    standing, changing = told(view, "MP5", [changed], start={"x": (0.0, 0.0)})
    assert "- x, 0 = Idle, 1 = Run\n" in standing
    assert "x: 0 (Idle), then 1 (Run) from 5 s, 0 (Idle) from 8 s, 1 (Run) from 9 s" in changing
    assert "x stays: 2 times at 0 (Idle), the shortest for 1 s from 8 s; 2 times at 1 (Run)" in changing


def test_of_a_counter_that_rises_far_its_first_values_and_the_last_are_told() -> None:
    view = View.of(lag_problem("G[0,10] (x <= 0.9)"))
    view = replace(view, info=ModelInfo("m", variables=(Variable("x", kind="integer"),)))
    times = np.linspace(0.0, 10.0, 101)
    reached = Reached(view)
    rises = "; ".join(f"x {n} -> {n + 1} at {n + 1} s" for n in (2, 3, 8))
    for top, values, changes in (
        (0, (), ""),
        (2, ("x 1", "x 2"), "x 0 -> 1 at 1 s; x 1 -> 2 at 2 s"),
        (9, ("x 3", "x 4", "x 9"), f"{rises}; ..."),
    ):
        trajectory = Trajectory(times, {"x": np.minimum(times // 1, top), "u": 0 * times})
        progress = SampleProgress.of(view, trajectory)
        told = reached.switches(progress, trajectory)
        assert re.sub(r" \(.*?\)", "", told) == changes
        assert reached.news(progress) == values


def test_of_many_inputs_those_that_jump_at_a_change_are_told() -> None:
    names = [f"u{k}" for k in range(1, 9)]
    space = SearchSpace(tuple(InputRange(n, 0, 1, control_points=2) for n in names), (), 10.0)
    info = ModelInfo("m", variables=(Variable("x", kind="boolean"),))
    view = replace(View.of(lag_problem("G[0,10] (x <= 0.9)")), info=info, space=space)
    times = np.linspace(0.0, 10.0, 101)
    columns = {name: np.where(times >= k, 1.0, 0.0) for k, name in enumerate(names, start=1)}
    trajectory = Trajectory(times, {"x": np.where(times >= 3, 1.0, 0.0), **columns})
    told = Reached(view).switches(SampleProgress.of(view, trajectory), trajectory)
    assert told == "x 0 -> 1 at 3 s (u3 0 for 3 s -> 1)"


def test_the_first_changes_of_a_counter_are_the_first_in_time() -> None:
    view = switch_and_counter()
    times = np.linspace(0.0, 10.0, 101)
    trajectory = Trajectory(times, {"x": np.where(times >= 9, 1.0, 0.0), "n": times // 1})
    told = Reached(view).switches(SampleProgress.of(view, trajectory), trajectory)
    assert told == "n 0 -> 1 at 1 s; n 1 -> 2 at 2 s; x 0 -> 1, n 8 -> 9 at 9 s; n 9 -> 10 at 10 s; ..."


def test_a_value_that_a_signal_had_or_passed_when_it_was_not_discrete_is_not_new() -> None:
    reached = Reached(View.of(PROBLEM))
    for stages, ranges, new in (
        ((), {"x": (0.0, 0.0)}, ()),
        ((0, 2), {}, ("x 2",)),
        ((), {"x": (0.0, 1.5)}, ()),
        ((0, 1, 4), {}, ("x 4",)),
        ((), {"x": (-1.0, 3.5)}, ("x down to -1, before 0",)),
    ):
        values = frozenset(("x", None, float(value)) for value in stages)
        assert reached.news(SampleProgress(values, ranges)) == new


def test_what_was_tried_for_a_moment_or_failed_was_tried() -> None:
    problem, failing = lag_problem(), lag_problem(response=lambda *_: {"x": np.array([np.nan])})
    for signal, told_ in (
        (Signal((0.0, 5.01, 5.02, 5.03), (-1.0, -1.0, 0.5321, -1.0), "linear"), ""),
        (Signal((0.0,), (-0.6321,), "constant"), "u above -0.6321 up to 1"),
        (Signal((0.0,), (0.1,), "constant"), "u from -1 to below 0.1, above 0.1 up to 1"),
    ):
        tried = Tried(View.of(problem))
        tried.add(Candidate({"u": signal}))
        assert tried.gaps == told_
    samples = [*sampled(problem, *2 * [[-1.0] * 4]), *sampled(failing, [0.9] * 4)]
    _, text = told(problem, "MP5", samples)
    assert "no verdict" in text and "Not tried so far: u between -1 and 0.9." in text


def test_values_that_were_not_tried_are_told_of_each_kind() -> None:
    space = SearchSpace(
        (
            InputRange("u", -1.0, 1.0, control_points=2, interpolation="linear", hold=None, free=None),
            InputRange(
                "n", 0, 9, control_points=2, interpolation="constant", hold=None, free=None, kind="integer"
            ),
        ),
        (ParameterRange("R", 1e-6, 1e-2, scale="log"),),
        10.0,
    )
    tried = Tried(replace(View.of(PROBLEM), space=space))
    tried.add(space.decode([-1.0, -0.5, 0, 9, 1e-6]))
    assert tried.gaps == "u above -0.5 up to 1; n = 1, 2, 3, 4, 5, 6, ...; R above 1e-06 up to 0.01"
    tried.add(space.decode([-1.0, 1.0, 1, 2, 1e-5]))
    assert tried.gaps == "n = 3, 4, 5, 6, 7, 8; R above 1e-05 up to 0.01"


def test_ranges_in_which_the_same_was_not_tried_are_told_together() -> None:
    inputs = (InputRange(name, 0, 1, control_points=2, interpolation="linear") for name in ("u", "v", "w"))
    space = SearchSpace(tuple(inputs), (), 10.0)
    tried = Tried(replace(View.of(PROBLEM), space=space))
    tried.add(space.decode([0.0, 0.1, 0.0, 0.1, 0.0, 0.5]))
    assert tried.gaps == "u and v above 0.1 up to 1; w above 0.5 up to 1"
    many = tuple(InputRange(f"u{k}", 0, k, control_points=2) for k in range(1, 6))
    assert Tried(replace(View.of(PROBLEM), space=SearchSpace(many[1:], (), 10.0))).gaps.count("; ") == 3
    assert Tried(replace(View.of(PROBLEM), space=SearchSpace(many, (), 10.0))).gaps == ""


def test_no_range_is_told_of_a_signal_that_was_discrete_in_some_samples() -> None:
    view, times = View.of(lag_problem("G[0,10] (x <= 0.9)")), np.linspace(0.0, 10.0, 101)
    reached = Reached(view)
    for column, extent in ((times / 20, "Ranges so far: x 0 to 0.5."), (times // 2, "")):
        reached.news(SampleProgress.of(view, Trajectory(times, {"x": column})))
        assert reached.extent(()) == extent


@pytest.mark.parametrize(
    ("formula", "is_told"), [("G (x <= 0.5 or u >= -0.5)", False), ("G (x <= 0.9)", True)]
)
def test_the_times_that_decided_are_pointed_out_unless_several_things_are_needed(
    formula: str, *, is_told: bool
) -> None:
    problem = lag_problem(formula)
    _, changing = told(problem, "MP5", sampled(problem, [1.0, 1.0, -1.0, -1.0], [0.0, 1.0, 1.0, -1.0]))
    assert ("Look at the times that decided the robustness values, and" in changing) == is_told


def test_how_to_go_on_follows_from_whether_the_last_two_samples_were_better() -> None:
    falling = [[0.1] * 5, [0.3] * 5, [0.5] * 5]
    better, worse = (asked_each(PROBLEM, sampled(PROBLEM, *each))[-1] for each in (falling, falling[::-1]))
    stuck = "The last two samples were no better.\n\nTry something else, unless the best ones are close"
    for text in (stuck, "Not tried so far", "Ranges"):
        assert text in worse.content and text not in better.content


def test_all_changes_of_a_moment_are_told_if_one_of_them_is_new() -> None:
    view = switch_and_counter()
    times = np.linspace(0.0, 10.0, 11)
    reached, told = Reached(view), list[str]()
    switched = np.where(times >= 4, 1.0, 0.0)
    for n in (np.zeros_like(times), switched):
        trajectory = Trajectory(times, {"x": switched, "n": n})
        progress = SampleProgress.of(view, trajectory)
        told.append(reached.switches(progress, trajectory))
        reached.news(progress)
    assert told == ["x 0 -> 1 at 4 s", "x 0 -> 1, n 0 -> 1 at 4 s"]


def test_samples_are_the_best_by_how_long_what_must_recur_failed() -> None:
    problem = lag_problem("G[0,6] F[0,3] (x >= 0.2)")
    low, high = [1.0, 1.0, -1.0, -1.0], [1.0, 1.0, 1.0, -1.0]
    _, changing = told(problem, "MP5", sampled(problem, high, low))
    (line,) = re.findall(r"x >= 0\.2 was false .*", changing)
    assert re.match(r".* for \S+ s in sample 2, \S+ s in sample 1; 3 s violate the requirement\.", line)
    assert "Lowest robustness" not in changing and "Look at the time" not in changing
    # Also where the robustness is the same, as that of a Boolean is however long it was false.
    flat = lag_problem("G[0,6] F[0,3] (u >= 0.5)")
    _, changing = told(flat, "MP5", sampled(flat, [1.0, -1.0, -1.0, -1.0], [-1.0] * 4))
    assert "The robustness is flat" in changing
    assert re.search(r"u >= 0\.5 was false .* for \S+ s in sample 2, \S+ s in sample 1;", changing)


def test_values_at_which_an_input_stayed_shortly_are_told() -> None:
    free = Freedom(20, 0.1)
    kinds: dict[str, Any] = {"interpolation": "constant", "control_points": 2}
    inputs = (
        InputRange("on", 0, 1, kind="integer", free=free, **kinds),
        InputRange("u", 0, 1, free=free, **kinds),
        InputRange("v", 0, 1, control_points=2, interpolation="linear"),
    )
    view = replace(View.of(PROBLEM), space=SearchSpace(inputs, (), 10.0))
    tried = Tried(view)

    def add(on: Sequence[float], u: Sequence[float], interpolation: Interpolation = "constant") -> None:
        signals = {
            "on": Signal((0.0, 2.496, 5.0, 6.0), tuple(on), "constant"),
            "v": Signal((0.0, 10.0), (0.0, 1.0), "linear"),
        }
        signals["u"] = Signal((0.0, 1.0, 3.0, 4.0), tuple(u), interpolation)
        tried.add(Candidate(signals))

    add((1, 0, 1, 1), (0.0, 0.5, 0.5, 1.0), "linear")
    assert "on at 0 for more than 2.52 s of 10 s, at 1 for more than 5 s of 10 s; u at a value" in tried.gaps
    add((0, 0, 0, 0), (0.4, 0.5, 0.5, 0.5))
    add((1, 1, 1, 1), (0.15, 0.05, 0.35, 0.65))
    assert tried.gaps == "u constant between 0.2 and 0.3, constant between 0.7 and 1"
    tried = Tried(view)
    for k in range(10):
        add((1, 1, 1, 1) if k % 2 else (0, 0, 0, 0), (0.0, 0.0, 0.001 * k, max(0.25, 0.05 + k / 10)))
    assert tried.gaps == "u constant between 0.1 and 0.2"
