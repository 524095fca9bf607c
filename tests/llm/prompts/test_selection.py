from dataclasses import replace

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.selection import RECENT, depths, recent, recent_best_and_different
from falsifier.llm.prompts.view import View
from falsifier.stl import Verdict
from falsifier.testing import START, lag_problem

VIEW = View.of(lag_problem(parameters=[START]))


def sample(level: float, robustness: float | None, x0: float = 0.0) -> Evaluation:
    verdict = None if robustness is None else Verdict(robustness, 0.0, "x <= 0.9")
    candidate = Candidate({"u": Signal((0.0,), (level,), "constant")}, {"x0": x0})
    return Evaluation(candidate, "ok" if verdict else "failed", verdict)


def test_the_most_recent_ones_with_a_verdict() -> None:
    samples = [sample(0.0, 1.0) for _ in range(14)]
    samples[12] = sample(0.0, None)
    assert recent(samples) == dict.fromkeys([3, 4, 5, 6, 7, 8, 9, 10, 11, 13], "")
    assert len(recent(samples)) == RECENT
    assert recent([]) == {} == recent([sample(0.0, None)])


def test_failed_samples_are_told_among_the_recent_ones() -> None:
    samples = [sample(0.0, 1.0), sample(0.0, None)]
    assert list(recent_best_and_different(VIEW, samples)) == [0, 1]


def test_the_best_are_kept_whatever_their_age_and_marked() -> None:
    samples = [sample(0.1, 0.2), sample(0.1, 0.1), *(sample(0.0, 1.0) for _ in range(RECENT))]
    chosen = recent_best_and_different(VIEW, samples)
    assert list(chosen) == list(range(12))
    assert chosen[0] != chosen[1] and chosen[0] and chosen[1]
    assert not any(chosen[i] for i in range(2, 12))


def test_a_recent_best_one_is_marked_in_its_place() -> None:
    samples = [sample(0.0, 1.0), sample(0.0, 0.5)]
    chosen = recent_best_and_different(VIEW, samples)
    assert list(chosen) == [0, 1]
    assert chosen[1] and chosen[1] != chosen[0]


def test_two_old_ones_that_differ_most_are_kept_by_input_or_parameter() -> None:
    old = [sample(0.0, 1.0), sample(-1.0, 1.0), sample(0.01, 1.0), sample(0.0, 1.0, x0=1.0)]
    samples = [*old, *(sample(0.02, 0.5 + 0.01 * i) for i in range(RECENT))]
    chosen = recent_best_and_different(VIEW, samples)
    assert sorted(i for i in chosen if i < 4) == [1, 3]


def test_a_failed_old_one_is_never_kept() -> None:
    samples = [sample(-1.0, None), *(replace(sample(0.0, 1.0)) for _ in range(RECENT))]
    assert 0 not in recent_best_and_different(VIEW, samples)


def test_equal_samples_are_neither_best_nor_second_best() -> None:
    flat = [sample(0.1 * i, 0.5) for i in range(3)]
    assert set(recent_best_and_different(VIEW, flat).values()) == {""}


def test_most_is_told_of_the_best_and_the_latest_sample() -> None:
    samples = [sample(0.0, r) for r in (0.3, 0.1, 0.2, 0.9, 0.8, 0.7, 0.6)]
    assert depths(range(7), samples) == {
        0: "summary", 1: "close", 2: "plain", 3: "summary", 4: "plain", 5: "plain", 6: "close"
    }  # fmt: skip
    assert depths([0], [sample(0.0, None)]) == {}
