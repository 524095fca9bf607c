from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.model import Experiment, FunctionModel, ModelInfo, Variable
from falsifier.core.space import Freedom, InputRange, SearchSpace
from falsifier.engines.grid import Grid
from falsifier.engines.layout import planning_layout
from falsifier.engines.surrogate import Settings, Surrogate
from falsifier.engines.surrogate.automaton.automaton import Automaton, learn
from falsifier.engines.surrogate.automaton.predictions import AutomatonLearner
from falsifier.engines.surrogate.history import History
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl import parse
from tests.engines.surrogate.automaton.support import CELL, CELLS, PUCK, driven
from tests.engines.surrogate.support import SETTINGS

Floats = NDArray[np.float64]
STOP = CELL * CELLS


def puck_problem(formula: str = "G[0,30] (x <= 0.9)") -> Problem:
    def simulate(times: Floats, inputs: dict[str, Floats], parameters: dict[str, float]) -> dict[str, Floats]:
        middles = (np.arange(CELLS) + 0.5) * CELL
        held = np.interp(middles, times, inputs["u"])
        return {"x": np.asarray(PUCK.solve(held).outputs[:, 0], np.float64)}

    info = ModelInfo("puck", variables=(Variable("u", causality="input"), Variable("x", causality="output")))
    space = SearchSpace((InputRange("u", 0.0, 1.0, control_points=5, free=Freedom(CELLS, CELL)),), (), STOP)
    experiment = Experiment(STOP, 0.01, ("x",))
    return Problem(FunctionModel(simulate, info), Requirement("R", parse(formula)), space, experiment)


def history(problem: Problem, simulations: int) -> History:
    grid = Grid.over(STOP, STOP, cells=CELLS, shortest=0.01)
    made = History(problem, grid, planning_layout(problem.space, grid), SETTINGS)
    for u in driven(simulations):
        made.add(evaluate(problem, made.layout.candidate(u, origin="t", rationale="t")), "t")
    return made


def test_states_and_envelopes_are_those_of_the_simulation() -> None:
    known = history(puck_problem(), 3)
    learnt = known.automaton(seed=0)
    assert learnt is not None
    assert learnt.error < 0.01
    for sample in history(puck_problem(), 6).samples[3:]:
        inputs = sample.trace.inputs[None]
        predicted = learnt.predict(inputs, sample.trace.states[None, 0])
        assert predicted.states[0] == pytest.approx(sample.trace.states, abs=1e-3)
        # The puck turns between two samples of the output; the automaton knows where.
        assert predicted.excess[0] == pytest.approx(sample.trace.excess, abs=0.02)


def test_it_is_learnt_once_until_it_is_doubted() -> None:
    known = history(puck_problem(), 3)
    first = known.automaton(seed=0)
    assert first is not None
    assert known.automaton(seed=1) is first
    known.learner.doubt()
    again = known.automaton(seed=1)
    assert again is not None
    assert again is not first


def test_one_that_does_not_repeat_its_simulations_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    from falsifier.engines.surrogate.automaton import predictions

    def wrong(*arguments: object) -> object:
        automaton = learn(*arguments)  # type: ignore[arg-type]
        return None if automaton is None else replace(automaton, laws=automaton.laws * 0.5)

    monkeypatch.setattr(predictions, "learn", wrong)
    assert history(puck_problem(), 3).automaton(seed=0) is None


def escaping(automaton: Automaton, stiffness: float) -> Automaton:
    """Unstable, and without walls."""
    laws = automaton.laws.copy()
    laws[:, :, 2] = stiffness
    never = replace(automaton.guards[0], source=1)
    return replace(automaton, laws=laws, guards=(never,))


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("stiffness", [400.0, 4000.0])
def test_one_that_escapes_to_infinity_is_not_believed(
    stiffness: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    from falsifier.engines.surrogate.automaton import predictions

    def wrong(*arguments: object) -> object:
        automaton = learn(*arguments)  # type: ignore[arg-type]
        return None if automaton is None else escaping(automaton, stiffness)

    monkeypatch.setattr(predictions, "learn", wrong)
    assert history(puck_problem(), 3).automaton(seed=0) is None


def test_predictions_that_escape_to_infinity_can_be_compared() -> None:
    known = history(puck_problem(), 3)
    learnt = known.automaton(seed=0)
    assert learnt is not None
    wrong = replace(learnt, automaton=escaping(learnt.automaton, 4000.0))
    trace = known.samples[0].trace
    predicted = wrong.predict(trace.inputs[None], trace.states[None, 0])
    assert np.isfinite(predicted.states).all()
    assert np.isfinite(predicted.excess).all()


def test_simulations_with_many_events_are_kept() -> None:
    problem = puck_problem()
    made = history(problem, 3)
    quiet = made.layout.candidate(np.full(CELLS, 0.5), origin="t", rationale="t")
    evaluation = evaluate(problem, quiet)
    assert evaluation.trajectory is not None
    for _ in range(9):
        sample = made.add(evaluation, "t")
        assert sample is not None
    kept = [recording.kinks for recording, _ in made.learner._heard]
    assert len(kept) == 6
    again = kept[-1]
    lively = [r.kinks for r, _ in history(problem, 3).learner._heard if r.kinks > again]
    assert lively
    assert set(lively) <= set(kept)


def test_foresight_learns_nothing_for_later() -> None:
    problem = puck_problem("G[0,28] (F[0,2] (x <= 0.85))")
    settings = Settings(trial_share=0.0, constants=0, probes=0, bangs=0)
    one, other = (Surrogate(problem, seed=0, settings=settings) for _ in range(2))
    for u in driven(6):
        told = evaluate(problem, one.layout.candidate(u, origin="t", rationale="t"))
        one.tell([told])
        other.tell([told])
        one.foresee([told.candidate])
    assert one.is_trusted == other.is_trusted
    for _ in range(4):
        (asked,), (same,) = one.ask(), other.ask()
        assert asked.key == same.key
        evaluation = evaluate(problem, asked)
        one.tell([evaluation])
        other.tell([evaluation])


def test_what_is_too_large_is_not_kept() -> None:
    problem = puck_problem()
    learner = AutomatonLearner()
    made = history(problem, 1)
    candidate: Candidate = made.layout.candidate(np.zeros(CELLS), origin="t", rationale="t")
    trajectory = evaluate(problem, candidate).trajectory
    assert trajectory is not None
    many = replace(trajectory, columns={f"x{i}": trajectory["x"] for i in range(21)})
    learner.hear(problem.space, list(many.columns), candidate, many, made.samples[0].trace)
    assert learner.current(made.scaled_objective(), np.random.default_rng(0)) is None
    assert learner._heard == []
