import pytest

from falsifier.errors import ChatError
from falsifier.evaluation.evaluate import evaluate
from falsifier.llm.prompts import Prompt, View, build_prompt, trimmed, variant_named
from falsifier.llm.prompts.trim import size
from falsifier.testing import lag_problem


def long_prompt() -> Prompt:
    problem = lag_problem()
    points = [[-1.0, -1.0, 1.0, 1.0], [0.8] * 4, *([0.01 * i] * 4 for i in range(15))]
    evaluations = [evaluate(problem, problem.space.decode(p)) for p in points]
    return build_prompt(View.of(problem), variant_named("MP5"), evaluations)


def test_what_fits_stays_as_it_is() -> None:
    prompt = long_prompt()
    assert trimmed(prompt, size(prompt)) == prompt


@pytest.mark.parametrize("share", [0.95, 0.8, 0.6, 0.45, 0.35])
def test_the_history_gives_way_and_the_rest_stays(share: float) -> None:
    prompt = long_prompt()
    limit = int(share * size(prompt))
    smaller = trimmed(prompt, limit)
    assert size(smaller) <= limit
    assert smaller.model_copy(update={"history": prompt.history}) == prompt


def test_courses_of_old_samples_go_first() -> None:
    prompt = long_prompt()
    smaller = trimmed(prompt, size(prompt) - 60)
    assert prompt.history is not None and smaller.history is not None
    assert len(smaller.history.samples) == len(prompt.history.samples)
    lost = [
        s.number for s, old in zip(smaller.history.samples, prompt.history.samples, strict=True) if s != old
    ]
    recent = [s.number for s in prompt.history.samples if s.details and not s.mark]
    assert lost == recent[: len(lost)]
    assert all(s.facts for s in smaller.history.samples)


def test_the_best_and_the_latest_sample_keep_their_courses_longest() -> None:
    prompt = long_prompt()
    limit = size(prompt)
    kept: list[list[int]] = []
    while not kept or any(kept[-1]):
        assert prompt.history is not None
        kept.append([s.number for s in prompt.history.samples if s.details])
        prompt, limit = trimmed(prompt, limit), limit - 40
    order = list(dict.fromkeys(map(tuple, kept)))
    best = 1
    assert order[-3:] == [(best, 17), (best,), ()]


def test_the_best_sample_stays_longest() -> None:
    prompt = long_prompt()
    assert prompt.history is not None
    bare = size(prompt.model_copy(update={"history": None}))
    smaller = trimmed(prompt, bare + 190)
    assert smaller.history is not None
    assert [s.mark for s in smaller.history.samples] == ["best so far", ""]
    assert smaller.history.samples[-1].number == 17, "the latest one"
    lost = len(prompt.history.samples) - len(smaller.history.samples)
    assert smaller.history.omitted == prompt.history.omitted + lost


def test_what_cannot_fit_is_an_error() -> None:
    with pytest.raises(ChatError, match="raise the limit"):
        trimmed(long_prompt(), 100)
