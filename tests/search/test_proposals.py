from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.errors import CandidateError, JournalError, SpecError
from falsifier.evaluation.evaluate import Evaluation
from falsifier.record.run import falsify, resume
from falsifier.testing import lag_problem


def level(value: float, name: str = "u") -> Candidate:
    signal = Signal.evenly((value,) * 4, stop_time=10.0, interpolation="linear")
    return Candidate({name: signal}, {}, "mine", "why not")


class Mine:
    """An engine that always returns the same."""

    name = "mine"

    def __init__(self, *candidates: Candidate) -> None:
        self.candidates = list(candidates)
        self.told: list[Evaluation] = []

    def ask(self, n: int = 1) -> list[Candidate]:
        return list(self.candidates)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self.told += evaluations


@pytest.mark.parametrize(
    ("candidate", "message"),
    [
        (level(5.0), r"input 'u': 5 is outside its range \[-1, 1\]"),
        (level(1.0, "throttle"), "engine 'mine': unknown input or parameter 'throttle'"),
        (Candidate(), "engine 'mine': input 'u' is missing"),
        (Candidate({"u": Signal((0.0,), (1.0,))}), "engine 'mine': input 'u': expected 4 evenly spaced"),
        (
            Candidate({"u": Signal((0, 1, 2, 10), (0,) * 4, "linear")}),
            "got one at 2 s instead of 6.66666667 s",
        ),
    ],
)
def test_a_candidate_outside_the_space_is_never_simulated(candidate: Candidate, message: str) -> None:
    with pytest.raises(CandidateError, match=message):
        falsify(lag_problem(), Mine(candidate), budget=3)


def test_an_engine_without_candidates_does_not_stall_the_run() -> None:
    with pytest.raises(SpecError, match="engine 'mine' returned no candidate"):
        falsify(lag_problem(), Mine(), budget=3)


def test_an_engine_that_makes_a_signal_of_nan_is_named() -> None:
    class Broken(Mine):
        def ask(self, n: int = 1) -> list[Candidate]:
            return [level(float("nan"))]

    with pytest.raises(SpecError, match=r"engine 'mine': control-point .* finite numbers, got nan"):
        falsify(lag_problem(), Broken(), budget=3)


def test_more_candidates_than_asked_for_are_refused() -> None:
    with pytest.raises(SpecError, match=r"engine 'mine' returned 2 candidates: ask\(1\)"):
        falsify(lag_problem(), Mine(level(0.0), level(0.5)), budget=3)


def test_what_is_admitted_is_simulated_recorded_and_resumed(tmp_path: Path) -> None:
    problem = lag_problem("G[0,10] (x <= 2)")
    (u,) = problem.space.inputs
    problem = replace(problem, space=replace(problem.space, inputs=(replace(u, hold=0.5, kind="integer"),)))
    engine = Mine(level(0.4))
    falsify(problem, engine, budget=1, directory=tmp_path)
    signal = engine.told[0].candidate.signals["u"]
    assert (signal.values, signal.hold) == ((0.0,) * 4, 0.5)
    (result,) = resume(tmp_path, problems=[problem], engine=Mine(level(0.4)), budget=2)
    assert [e.candidate.signals["u"] for e in result.evaluations] == [signal, signal]
    with pytest.raises(JournalError, match="differs from the journal"):
        resume(tmp_path, problems=[problem], engine=Mine(level(0.9)), budget=3)


@pytest.mark.parametrize("returned", [level(1.0), (level(x) for x in (0.1, 0.2)), [5], None, "u"])
def test_what_is_no_list_of_candidates_is_named(returned: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    engine = Mine()
    monkeypatch.setattr(engine, "ask", lambda n=1: returned, raising=True)
    with pytest.raises(SpecError, match=r"engine 'mine': ask\(n\) must return a list of Candidate, got"):
        falsify(lag_problem(), engine, budget=3)


@pytest.mark.parametrize("given", [5, b"uniform", object(), SimpleNamespace(name=5, ask=print, tell=print)])
def test_what_is_no_engine_is_refused(given: Any) -> None:
    with pytest.raises(SpecError, match=r"expected an object with name, ask\(\) and tell\(\), or"):
        falsify(lag_problem(), given)


@pytest.mark.parametrize("given", [None, 5, [[lag_problem()]], [None]])
def test_what_is_no_problem_is_refused(given: Any) -> None:
    with pytest.raises(SpecError, match="expected a Problem"):
        falsify(given)
