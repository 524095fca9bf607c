"""The one way to search, as users call it."""

import json
import sys
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

import pytest
from numpy import int64

from falsifier.core.candidate import Candidate
from falsifier.core.experiment import Experiment
from falsifier.core.files import bundled
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.counterexamples.store import changes_since, load_counterexample
from falsifier.engines import make_engine
from falsifier.engines.protocol import Engine
from falsifier.errors import CandidateError, JournalError, SimulationError, SpecError
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from falsifier.record import manifest
from falsifier.record.journal import holds_run, simulated
from falsifier.record.run import StopFile, falsify, resume
from falsifier.search.budget import Budget
from falsifier.search.events import Evaluated, Event, RunStarted
from falsifier.search.make_engines import make_engines
from falsifier.search.request import LLMSettings
from falsifier.testing import lag, lag_problem
from tests.problems import broken, easy, easy_again, hard, impossible, stepped
from tests.searches import Wrapped
from tests.stepped import EulerModel

EASY = "python:tests.problems:easy"


def reply(level: float) -> str:
    return json.dumps({"rationale": "", "signals": [{"name": "u", "values": [level] * 4}]})


@pytest.mark.parametrize(
    "problem", [easy(), EASY, ProblemSource(target=EASY)], ids=["problem", "name", "source"]
)
def test_a_problem_is_given_as_itself_by_its_name_or_by_its_source(problem: object) -> None:
    result = falsify(problem, "corners", budget=5)  # type: ignore[call-overload]
    assert (result.problem.name, result.falsified) == ("EASY", True)
    assert result.directory is None


def test_several_problems_give_several_results_in_their_order() -> None:
    apart = lag_problem(points=2, name="APART")
    results = falsify([impossible(), apart, hard()], "corners", budget=5)
    assert [r.problem.name for r in results] == ["NEVER", "APART", "HARD"]
    assert [r.falsified for r in results] == [False, True, True]
    (only,) = falsify([easy()], "corners", budget=5)
    assert only.falsified


@pytest.mark.parametrize("other", [easy_again(), lag_problem(points=2, name="EASY")], ids=["shared", "apart"])
def test_problems_of_one_call_have_different_names(other: Problem, tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"two of the problems are named 'EASY'.*name=\.\.\."):
        falsify([easy(), hard(), other], "corners", budget=5, directory=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_formulas_for_one_fmu_are_named_and_loaded_again(tmp_path: Path) -> None:
    formulas = {"low": "G[0,1] (wheel <= 500)", "high": "G[0,1] (engine <= -1)"}
    fmu = bundled("fmus") / "AT.fmu"
    problems = [
        Problem.from_fmu(fmu, formula, name=name, context=[f"{name}.md"])
        for name, formula in formulas.items()
    ]  # each has files of its own, and they share the search all the same
    results = falsify(problems, "corners", budget=1, directory=tmp_path)
    assert [(r.problem.name, r.falsified) for r in results] == [("low", False), ("high", True)]
    for again in ([], problems):  # both record what either of them names
        assert [r.problem for r in resume(tmp_path, problems=again)] == [r.problem for r in results]
        assert load_counterexample(tmp_path).problem is not None
    assert Problem.from_fmu(fmu, formulas["low"]).name == "stl"


def test_the_time_of_a_run_begins_with_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    def slowly(*arguments: Any) -> list[Engine]:
        sleep(0.2)  # as if its modules were imported
        return make_engines(*arguments)

    monkeypatch.setattr("falsifier.record.run.make_engines", slowly)
    began = perf_counter()
    assert falsify(easy(), "corners", budget=5).spent.seconds <= perf_counter() - began - 0.2


def test_the_budget_of_a_run_that_has_falsified_stays_as_it_was_given(tmp_path: Path) -> None:
    assert falsify(EASY, "corners", budget=9, directory=tmp_path).falsified
    resume(tmp_path, budget=50)
    assert manifest.read(tmp_path).request.budget.simulations == 9


@pytest.mark.parametrize(("budget", "status"), [(1, "not falsified"), (2, "interrupted")])
def test_who_stops_a_run_at_its_end_interrupts_nothing(budget: int, status: str, tmp_path: Path) -> None:
    (tmp_path / "stop").touch()
    stop = StopFile(tmp_path / "stop", Budget(budget))
    stop._looked = 0.0  # long ago
    assert falsify(impossible(), "uniform", budget=budget, listeners=[stop]).status == status


def test_problems_that_cannot_share_a_search_have_a_directory_each(tmp_path: Path) -> None:
    falsify([impossible(), lag_problem(points=2, name="APART")], "corners", budget=2, directory=tmp_path)
    assert {p.name for p in tmp_path.iterdir() if holds_run(p)} == {"NEVER", "APART"}
    falsify([impossible(), hard()], "corners", budget=2, directory=tmp_path / "shared")
    assert manifest.read(tmp_path / "shared").names == ("NEVER", "HARD")


def test_known_candidates_are_fitted_to_each_group_before_any_is_searched(tmp_path: Path) -> None:
    known = Candidate({"u": Signal((0.0, 10.0), (-1.0, 1.0), "linear")})
    narrow = lag_problem(limit=0.5, name="NARROW")
    with pytest.raises(CandidateError, match="start_from: input 'u' at t = 0 s: -1 is outside"):
        falsify([impossible(), narrow], "corners", start_from=[known], directory=tmp_path)
    assert not any(tmp_path.iterdir())


def test_whoever_interrupts_a_search_in_groups_stops_it_and_can_resume_all_of_it(tmp_path: Path) -> None:
    def stop(event: Event) -> None:
        if isinstance(event, Evaluated) and not event.replayed:
            raise KeyboardInterrupt

    problems = [impossible(), lag_problem(points=2, name="APART")]
    results = falsify(problems, "corners", budget=3, directory=tmp_path, listeners=[stop])
    assert [(r.status, r.spent.simulations) for r in results] == [("interrupted", 1), ("interrupted", 0)]
    (found,) = resume(tmp_path, problems=problems, listeners=[stop])
    assert (found.status, found.problem.name) == ("interrupted", "APART")
    assert "interrupted" not in {r.status for r in resume(tmp_path, problems=problems)}


def test_a_budget_that_one_of_several_runs_has_exceeded_continues_none(tmp_path: Path) -> None:
    problems = [impossible(), lag_problem(points=2, name="APART")]
    for problem, budget in zip(problems, (4, 2), strict=True):
        falsify(problem, "corners", budget=budget, directory=tmp_path / problem.name)
    before = simulated(tmp_path / "APART")
    with pytest.raises(SpecError, match="NEVER: this run has 4 simulations already"):
        resume(tmp_path, problems=problems, budget=3)
    assert simulated(tmp_path / "APART") == before


@pytest.mark.parametrize(
    ("name", "given"),
    [("seed", -1), ("seed", 0.5), ("jobs", 0), ("budget", 2.5), ("budget", "10"), ("budget", True)],
)
def test_numbers_that_cannot_be_used_are_named(name: str, given: object) -> None:
    with pytest.raises(SpecError, match=f"{name}: expected a whole number, at least"):
        falsify(easy(), "corners", **{name: given})  # type: ignore[call-overload]


def test_whole_numbers_may_be_those_of_numpy() -> None:
    result = falsify(impossible(), "uniform", budget=int64(3), seed=int64(7))  # type: ignore[call-overload]
    assert result.spent.simulations == 3


def test_a_chat_leads_by_itself_and_its_name_is_recorded(tmp_path: Path) -> None:
    result = falsify(
        EASY, llm=ScriptedChat([reply(0.0), reply(1.0)], llm="mine"), budget=5, directory=tmp_path
    )
    assert result.falsified and result.spent.calls == 2
    described = manifest.read(tmp_path)
    assert described.request.llm == LLMSettings(name="mine")
    assert described.request.source == ProblemSource(target=EASY)


def test_an_engine_made_in_python_searches_one_requirement() -> None:
    engine = make_engine("corners", easy(), seed=0)
    assert falsify(easy(), engine, budget=5).falsified
    with pytest.raises(SpecError, match="one requirement"):
        falsify((easy(), hard()), engine, budget=5)  # type: ignore[call-overload]


def test_a_directory_is_not_used_for_a_wrong_name(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="'corners'"):
        falsify(easy(), "corner", directory=tmp_path / "run")
    assert not (tmp_path / "run").exists()


class TestResume:
    def test_a_run_that_has_ended_is_what_it_was(self, tmp_path: Path) -> None:
        first = falsify(EASY, "corners", budget=5, directory=tmp_path)
        events: list[Event] = []
        (again,) = resume(tmp_path, listeners=[events.append])
        assert (again.status, again.robustness) == (first.status, first.robustness)
        assert again.spent.simulations == first.spent.simulations
        assert isinstance(events[0], RunStarted) and events[0].replayed == first.spent.simulations

    def test_with_more_budget_it_goes_on(self, tmp_path: Path) -> None:
        falsify("python:tests.problems:impossible", "uniform", budget=3, directory=tmp_path)
        (more,) = resume(str(tmp_path), budget=7)
        assert more.spent.simulations == 7
        whole = falsify(impossible(), "uniform", budget=7)
        assert [e.candidate.key for e in more.evaluations] == [e.candidate.key for e in whole.evaluations]
        (again,) = resume(tmp_path)
        assert again.spent.simulations == 7, "the new limit is that of the run"
        with pytest.raises(SpecError, match="has 7 simulations already"):
            resume(tmp_path, budget=6)

    def test_a_language_model_is_asked_only_for_what_a_larger_budget_adds(self, tmp_path: Path) -> None:
        def chat(*values: float) -> ScriptedChat:
            return ScriptedChat([reply(value) for value in values], llm="mine")

        never = "python:tests.problems:impossible"
        falsify(never, llm=chat(0.0, 0.1), budget=2, directory=tmp_path)
        (more,) = resume(tmp_path, chat=chat(0.2), budget=3)
        assert more.spent.calls == 3
        assert [e.candidate.signals["u"].values[0] for e in more.evaluations] == [0.0, 0.1, 0.2]

    def test_a_number_changes_the_limit_on_simulations_alone(self, tmp_path: Path) -> None:
        limits = Budget(3, seconds=1e6)
        falsify("python:tests.problems:impossible", "uniform", budget=limits, directory=tmp_path)
        events: list[Event] = []
        resume(tmp_path, budget=4, listeners=[events.append])
        assert isinstance(events[0], RunStarted) and events[0].budget == Budget(4, seconds=1e6)

    def test_a_folder_of_runs_is_resumed_one_by_one(self, tmp_path: Path) -> None:
        for name in ("easy", "impossible"):
            falsify(f"python:tests.problems:{name}", "corners", budget=2, directory=tmp_path / name)
        assert [r.problem.name for r in resume(tmp_path)] == ["EASY", "NEVER"]

    @pytest.mark.parametrize("here", [True, False])
    def test_a_module_that_has_changed_is_refused(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, here: bool
    ) -> None:
        (tmp_path / "cwd").mkdir()
        monkeypatch.chdir(tmp_path if here else tmp_path / "cwd")
        monkeypatch.syspath_prepend(tmp_path)
        name = f"changing_{here}"
        file = tmp_path / f"{name}.py"
        file.write_text("from tests.problems import impossible as problem\n")
        falsify(f"python:{name}:problem", "corners", budget=2, directory=tmp_path / "run")
        digest = sha256(file.read_bytes()).hexdigest()
        assert manifest.read(tmp_path / "run").hashes == {file.name if here else str(file): digest}
        assert resume(tmp_path / "run", budget=3)[0].spent.simulations == 3
        file.write_text("from tests.problems import easy as problem\n")
        with pytest.raises(JournalError, match=rf"{name}\.py has changed since the start"):
            resume(tmp_path / "run", budget=4)
        said = changes_since(manifest.read(tmp_path / "run").origin, load_problem(f"python:{name}:problem"))
        assert list(said) == [f"{name}.py has changed since it was stored"]
        monkeypatch.delitem(sys.modules, name)

    def test_what_was_made_in_python_must_be_given_again(self, tmp_path: Path) -> None:
        falsify(EASY, Wrapped(easy()), budget=2, directory=tmp_path / "engine")
        with pytest.raises(JournalError, match="engine="):
            resume(tmp_path / "engine")
        with pytest.raises(JournalError, match="has the engine 'wrapped', not 'uniform'"):
            resume(tmp_path / "engine", engine=make_engine("uniform", easy(), seed=0))
        (result,) = resume(tmp_path / "engine", engine=Wrapped(easy()), budget=3)
        assert result.spent.simulations == 3

    def test_a_changed_problem_is_refused(self, tmp_path: Path) -> None:
        falsify(lag_problem(), "uniform", budget=2, directory=tmp_path)
        with pytest.raises(JournalError, match="LAG has changed"):
            resume(tmp_path, problems=[lag_problem(limit=2.0)])


def test_a_loaded_problem_that_was_changed_counts_as_made_in_python(tmp_path: Path) -> None:
    problem = load_problem("AT1")
    changed = replace(problem, experiment=replace(problem.experiment, step_size=0.005))
    falsify(changed, "corners", budget=1, directory=tmp_path)
    assert manifest.read(tmp_path).request.problems == ()


CHASE = "G[0,100] (car5.mode <= 2)"


def test_a_run_that_another_process_made_meanwhile_in_the_same_folder_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two jobs of a script that were given one folder: the second had found it empty."""

    def begun(*arguments: Any, **options: Any) -> Any:
        monkeypatch.undo()
        falsify(impossible(), "uniform", budget=2, directory=tmp_path)
        return make_engines(*arguments, **options)

    monkeypatch.setattr("falsifier.record.run.make_engines", begun)
    with pytest.raises(JournalError, match="already contains a run"):
        falsify(impossible(), "uniform", budget=3, directory=tmp_path)
    (result,) = resume(tmp_path, problems=[impossible()])
    assert result.spent.simulations == 2


def test_engines_see_internal_variables_and_a_resumed_run_those_that_it_had(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fmu = bundled("fmus") / "CC.fmu"
    problems = [Problem.from_fmu(fmu, CHASE), Problem.from_fmu(fmu, "G[0,9] (y1 <= 9)", name="slope")]
    whole = falsify(problems, budget=20, seed=3)
    falsify(problems, budget=4, seed=3, directory=tmp_path / "a")
    described = manifest.read(tmp_path / "a")
    assert described.internals[-1] == described.modes[-1].name == "car4.mode"
    monkeypatch.setattr("falsifier.record.run.readable_internals", lambda *_: ())
    continued = resume(tmp_path / "a", budget=20)
    for result in (*whole, *continued):
        assert result.best is not None and result.best.trajectory is not None
        assert {"y1", "v1", "car4.mode"} <= set(result.best.trajectory.names)
        # Another version of the FMU, with which a counterexample is replayed, may not have them.
        assert "v1" not in result.problem.experiment.outputs
    unseen = falsify(problems, budget=20, seed=3)
    tried = [[e.candidate.key for e in results[0].evaluations] for results in (whole, continued, unseen)]
    assert tried[0] == tried[1] != tried[2]


def test_asking_for_internal_variables_takes_no_longer_than_the_search_may(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    limits: list[float | None] = []

    def hang(model: EulerModel, signals: object, parameters: object, experiment: Experiment) -> Trajectory:
        limits.append(experiment.time_limit)
        raise SimulationError("hung", status="timeout")

    problem = stepped(lag_problem())
    problem = replace(problem, model=EulerModel(problem.info))
    monkeypatch.setattr(EulerModel, "simulate", hang)
    for own in (None, 5.0):
        asked = replace(problem, experiment=replace(problem.experiment, internals=("v",), time_limit=own))
        falsify(asked, "uniform", budget=Budget(simulations=1, seconds=20.0))
        falsify(asked, "uniform", budget=1)
    assert limits[::2] == [20.0, None, 5.0, 5.0]


def test_engines_made_in_python_and_those_of_other_requirements_see_no_internal_variables(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fmu, seen = bundled("fmus") / "CC.fmu", dict[str, Problem]()
    chase, slope = Problem.from_fmu(fmu, CHASE), Problem.from_fmu(fmu, "G[0,9] (y1 <= 9)", name="slope")

    def made(name: str, problem: Problem, **options: Any) -> Engine:
        seen[problem.name] = problem
        return make_engine(name, problem, **options)

    monkeypatch.setattr("falsifier.search.make_engines.make_engine", made)
    falsify([chase, slope], budget=1)
    outputs = [problem.experiment.outputs for problem in seen.values()]
    assert set(outputs[0]) - set(outputs[1]) == set(chase.internals)
    falsify(chase, "hybrid", llm=ScriptedChat(["{}"] * 9), budget=1)
    assert set(seen[chase.name].experiment.outputs) == set(outputs[0])
    events = list[Event]()
    falsify(chase, make_engine("uniform", chase, seed=0), budget=1, listeners=[events.append])
    (evaluation,) = (event.evaluation for event in events if isinstance(event, Evaluated))
    assert evaluation.trajectory is not None and "v1" not in evaluation.trajectory.names


@pytest.mark.parametrize("seed", [0, 1])  # cannot be read the first time, only later
def test_no_simulation_fails_because_of_an_internal_variable(seed: int) -> None:
    lost = lag_problem("G[0,10] (x <= 2)", response=lambda *all: {"bias": broken(*all)["x"], **lag(*all)})
    lost = replace(stepped(lost), experiment=replace(lost.experiment, internals=("bias",)))
    events = list[Event]()
    found = falsify(lost, budget=30, seed=seed, listeners=[events.append]).evaluations
    alone = falsify(lag_problem("G[0,10] (x <= 2)"), budget=1, seed=seed).evaluations
    assert found[0].robustness == alone[0].robustness and all(e.status == "ok" for e in found)
    told = (e.evaluation.trajectory for e in events if isinstance(e, Evaluated))
    assert {"bias" in trajectory.names for trajectory in told if trajectory} == {False, True}


def test_of_internal_variables_prompts_tell_the_modes() -> None:
    problem = Problem.from_fmu(bundled("fmus") / "CC.fmu", CHASE)
    chat = ScriptedChat(["{}"] * 9)
    best = falsify(problem, "hybrid", llm=chat, budget=3).best
    assert best is not None and best.trajectory is not None and "car2.v" in best.trajectory.names
    asked = [str(request.messages) for request in chat.requests]
    assert asked and all("- car2.mode, integer: 1 keeping, 2 chasing, 3 braking" in text for text in asked)
    assert not any("car2.v" in text for text in asked)


def test_a_run_is_resumed_with_the_problems_that_it_searched(tmp_path: Path) -> None:
    loose = lag_problem("G[0,10] (x <= 5)", name="loose")
    falsify(loose, "uniform", budget=2, directory=tmp_path / "one")
    with pytest.raises(JournalError, match="this run searched loose: give all of them"):
        resume(tmp_path / "one", problems=[lag_problem(name="tight")])
    apart = [loose, lag_problem("G[0,10] (x <= 6)", name="wide", limit=2.0)]
    falsify(apart, "uniform", budget=2, directory=tmp_path / "two")
    resumed = resume(tmp_path / "two", problems=apart, budget=3)
    assert [(r.problem.name, r.spent.simulations) for r in resumed] == [("loose", 3), ("wide", 3)]
    with pytest.raises(JournalError, match="searched wide: give all of them"):
        resume(tmp_path / "two", problems=apart[:1])
