import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.function_model import FunctionModel
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.ranges import InputRange
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace
from falsifier.errors import CandidateError, FalsifierError, SimulationError, SpecError
from falsifier.evaluation.evaluate import evaluate, judge, readable_internals, simulate, start_values
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.testing import START, lag_problem
from tests.fmu.fixtures import altered, path as fmu_path
from tests.problems import broken, never, stepped

FULL = Candidate({"u": Signal((0.0,), (1.0,), "constant")})


def test_a_candidate_gets_its_verdict_and_its_trajectory_with_the_inputs() -> None:
    found = evaluate(lag_problem(), FULL)
    assert (found.status, found.reason, found.violated) == ("ok", "", True)
    # x(10) of x' = 1 - x by Euler with 0.1 s: 1 - 0.9**100
    assert found.robustness == pytest.approx(0.9 - (1 - 0.9**100))
    assert found.trajectory is not None
    assert found.trajectory.names == ("x", "u")
    assert found.trajectory.units == {"x": "m", "u": "V"}
    assert found.seconds >= 0
    shared: Any
    for shared in (found, pickle.loads(pickle.dumps(found))):  # by engines, listeners and the result
        columns = shared.trajectory.columns
        assert not any(array.flags.writeable for array in (shared.trajectory.times, *columns.values()))
        values, signals, units = shared.verdict.values, shared.candidate.signals, shared.trajectory.units
        for change in (columns.clear, signals.clear, units.clear, values.popitem):
            with pytest.raises(TypeError, match=r"read-only; dict\(...\) makes a copy"):
                change()


def test_a_model_need_not_list_its_variables() -> None:
    problem = lag_problem()
    assert isinstance(problem.model, FunctionModel)
    bare = replace(problem, model=replace(problem.model, info=ModelInfo("bare")))
    assert evaluate(bare, FULL).robustness == evaluate(problem, FULL).robustness


def test_a_parameter_of_the_candidate_goes_before_the_problems() -> None:
    problem = replace(lag_problem("G[0,0] (x <= 0.2)", parameters=[START]), parameters={"x0": 0.9})
    assert evaluate(problem, Candidate(FULL.signals, {"x0": 0.1})).robustness == pytest.approx(0.1)


def test_an_input_of_single_precision_is_judged_as_the_fmu_gets_it() -> None:
    same = Problem.from_fmu(
        fmu_path("Echo_3"), "G (out_Float32 == in_Float32)", inputs={"in_Float32": (-1, 1)}
    )
    found = simulate(same, {"in_Float32": 0.1})
    assert not found.violated and found.verdict and found.verdict.values["in_Float32"] == np.float32(0.1)


def test_inputs_that_nobody_drives_have_the_start_value_that_the_fmu_declares(tmp_path: Path) -> None:
    lying = altered(  # it holds 0
        fmu_path("Lag_2"), tmp_path / "Lag.fmu", lambda text: text.replace(b'start="0.0"', b'start="4.0"', 1)
    )
    problem = Problem.from_fmu(lying, "G (y <= 0.1 or u <= 3)", parameters={"T": (1, 2)})
    found = simulate(problem)
    assert found.trajectory is not None and found.trajectory["y"][-1] == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("response", [broken, never])
def test_a_simulation_that_fails_is_an_evaluation_with_a_reason(response: object) -> None:
    found = evaluate(lag_problem(response=response), FULL)  # type: ignore[arg-type]
    assert (found.status, found.verdict, found.trajectory) == ("failed", None, None)
    assert (found.robustness, found.violated) == (None, False)
    assert found.reason.startswith("lag: ")


def test_how_a_simulation_ended_and_what_it_said_are_kept() -> None:
    class Crashing:
        info = lag_problem().info

        def simulate(self, *_: object) -> None:
            raise SimulationError("gone", status="crashed", log=("last words",))

        def close(self) -> None:
            pass

    found = evaluate(replace(lag_problem(), model=Crashing()), FULL)  # type: ignore[arg-type]
    assert (found.status, found.reason, found.log) == ("crashed", "gone", ("last words",))


def test_what_cannot_be_judged_is_a_failed_evaluation() -> None:
    found = evaluate(lag_problem("G[0,10] (log(x - 5) <= 0)"), FULL)
    assert (found.status, found.trajectory) == ("failed", None)
    assert found.reason


def test_one_simulation_is_judged_for_several_requirements() -> None:
    found = evaluate(lag_problem("G[0,10] (x <= 2)"), FULL)
    again = judge(lag_problem(), found)
    assert again.robustness == evaluate(lag_problem(), FULL).robustness
    assert again.trajectory is found.trajectory
    failed = replace(found, trajectory=None, status="failed", verdict=None)
    assert judge(lag_problem(), failed) is failed
    assert judge(lag_problem("G[0,10] (sqrt(x - 5) <= 0)"), found).status == "failed"


class TestSimulate:
    """By values of one's own, without a search."""

    def test_numbers_are_constants_and_other_inputs_rest(self) -> None:
        found = simulate(lag_problem(inputs=2), {"u": 1.0})
        assert found.trajectory is not None
        assert set(found.trajectory["v"].tolist()) == {0.0}
        assert found.trajectory["x"][-1] == pytest.approx(1 - 0.9**100)
        assert found.candidate.origin == "user"

    def test_an_input_that_the_problem_keeps_constant_may_be_driven(self) -> None:
        problem = load_problem("AT1", inputs={"brake": 300})
        braking, free = (simulate(problem, {"throttle": 100.0, **more}) for more in ({}, {"brake": 0.0}))
        assert free.robustness == pytest.approx(-0.2133, abs=1e-3)
        assert braking.robustness is not None and braking.robustness > 10
        assert braking.trajectory is not None
        assert set(braking.trajectory["brake"].tolist()) == {300.0}

    @pytest.mark.parametrize(
        ("inputs", "parameters", "named"),
        [({"uu": 1.0}, {}, "'u'"), ({}, {"gian": 1.0}, "'gain'"), ({}, {"x": 1.0}, "'x'")],
    )
    def test_unknown_names_are_refused(
        self, inputs: dict[str, float], parameters: dict[str, float], named: str
    ) -> None:
        with pytest.raises(CandidateError, match=named):
            simulate(lag_problem(), inputs, parameters)


def test_outputs_at_time_0_and_whether_they_depend_on_what_is_chosen() -> None:
    assert start_values(lag_problem()) == {"x": (0.0, 0.0)}
    assert start_values(lag_problem(parameters=[START])) == {"x": (START.low, START.high)}
    low, high = start_values(lag_problem(inputs=2, response=lambda _, u, __: {"x": u["u"] - u["v"]}))["x"]
    assert low < high, "a difference that is the same at both ends of the search space"


def test_an_fmu_is_initialised_without_a_whole_simulation() -> None:
    problem = load_problem("AT1")
    assert start_values(problem) == {"speed": (0.0, 0.0), "rpm": (1000.0, 1000.0), "gear": (1.0, 1.0)}
    problem.model.close()


def test_a_component_whose_step_is_longer_than_an_output_step_is_no_hindrance() -> None:
    problem = load_problem("ATsplit1")  # the shift logic runs every 0.04 s, the outputs are read every 0.01 s
    assert start_values(problem)["car.rpm"] == (1000.0, 1000.0)
    problem.model.close()


def test_internal_variables_are_recorded_if_the_model_lets_them_be_read() -> None:
    shifting = load_problem("AT51")
    assert readable_internals([shifting]) == ("engine", "wheel")
    shifting.model.close()
    simple = stepped(lag_problem())
    refused = replace(simple, experiment=replace(simple.experiment, internals=("hidden",)))
    assert readable_internals([refused]) == readable_internals([simple, refused]) == ()


def test_a_simulation_is_repeated_without_internal_variables_only_if_one_cannot_be_read(
    tmp_path: Path,
) -> None:
    known, wrong = b'name="der(x)" valueReference="2"', b'name="der(x)" valueReference="99"'
    fmu = altered(
        fmu_path("Lag_2"), tmp_path / "lag.fmu", lambda text: text.replace(known, wrong), ending=".xml"
    )
    problem = Problem.from_fmu(fmu, "G[0,1] (y <= 50)", stop_time=1.0, inputs={"u": (0, 1)})
    middle = problem.space.decode(problem.space.bounds.mean(axis=1))
    assert evaluate(problem.recording(["der(x)"]), middle).status == "failed"
    assert (
        evaluate(problem.watching(["x", "der(x)"]), middle).robustness == evaluate(problem, middle).robustness
    )
    problem.model.close()
    calls = list[object]()

    def failing(*given: Any) -> Any:
        calls.append(given)
        return never(*given)

    failed = lag_problem(response=failing).watching(["bias"])
    assert evaluate(failed, failed.space.decode([0, 0, 0, 0])).status == "failed" and len(calls) == 1


def test_what_cannot_be_initialised_has_no_start() -> None:
    assert start_values(lag_problem(response=never)) == {}


@pytest.mark.parametrize(
    ("candidate", "message"),
    [
        (Candidate(), "input 'u' is missing"),
        (Candidate({"u": Signal((0.0,), (5.0,))}), r"'u' at t = 0 s: 5 is outside its range \[-1, 1\]"),
        (Candidate({"v": Signal((0.0,), (0.0,))}), "unknown input or parameter 'v'"),
    ],
)
def test_only_what_is_searched_is_evaluated(candidate: Candidate, message: str) -> None:
    with pytest.raises(CandidateError, match=message):
        evaluate(lag_problem(), candidate)


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({1: 100}, "the model has no input 1; known: u"),
        ("u3.csv", "u3.csv: cannot be read: No such file"),
        ({"u": [0, 1]}, r"inputs.u: expected a finite number or a Signal\(times, values\), got \[0, 1\]"),
        ({"u": None}, "inputs.u: .*got None"),
        ({"u": float("nan")}, "inputs.u: .*got nan"),
        ({"u": "1"}, "inputs.u: .*got '1'"),
        (
            ([0, 10], [0, 1]),
            "inputs: expected numbers or signals by name, a CSV file or a candidate, .*tuple",
        ),
    ],
)
def test_what_is_no_signal_is_named(inputs: Any, message: str) -> None:
    with pytest.raises(FalsifierError, match=message):
        simulate(lag_problem(), inputs)


def test_files_candidates_and_arrays_are_inputs(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    problem = lag_problem(parameters=[START])
    file = tmp_path / "u.csv"
    file.write_text("time,u\n0,0\n10,1\n")
    signal = Signal(np.array([0.0, 10.0]), np.array([0.0, 1.0]), "linear")  # type: ignore[arg-type]
    candidate = Candidate({"u": signal}, {"x0": 0.5})
    found = [
        simulate(problem, str(file), {"x0": 0.5}),
        simulate(problem, file, {"x0": 0.5}),
        simulate(problem, {"u": signal}, {"x0": 0.5}),
        simulate(problem, candidate),
        simulate(problem, candidate, {"x0": 0.0}),
    ]
    *same, other = [evaluation.robustness for evaluation in found]
    assert len(set(same)) == 1 and other not in same
    assert hash(signal) == hash(Signal((0.0, 10.0), (0.0, 1.0), "linear"))
    assert not caplog.messages
    file.write_text("time,u\n0,0\n5,1\n")
    simulate(problem, file)
    assert caplog.messages == [f"{file}: ends at 5 s; the last values are kept until 10 s"]


def test_numbers_as_text_are_no_parameters() -> None:
    with pytest.raises(SpecError, match=r"parameters.x0: expected a finite number, got '1'"):
        simulate(lag_problem(parameters=[START]), {}, {"x0": "1"})


@pytest.mark.parametrize(
    ("variable", "value", "message"),
    [
        (Variable("n", "integer", "input"), 1.5, "n = 1.5: expected an integer for 'n'"),
        (
            Variable("n", "integer", "input", type="Int64"),
            2**53 + 2,
            r"an integer from -\d+ to 9007199254740991 \(",
        ),
        (Variable("n", "integer", "input", type="Integer"), 2**31, "from -2147483648 to 2147483647 for"),
        (Variable("n", "boolean", "input"), 2, "n = 2: expected 0 or 1 for 'n'"),
        (Variable("n", "enumeration", "input", literals={"Off": 1, "On": 7}), 5, "one of 1 = Off, 7 = On"),
        (
            Variable("n", "integer", "input"),
            Signal((0, 1), (1, 2), "linear"),
            "cannot have linear .*'constant'",
        ),
    ],
)
def test_values_that_a_type_does_not_have_are_refused(variable: Variable, value: Any, message: str) -> None:
    problem = lag_problem()
    assert isinstance(problem.model, FunctionModel)
    info = replace(problem.info, variables=(*problem.info.variables, variable))
    changed = replace(problem, model=replace(problem.model, info=info))
    with pytest.raises(CandidateError, match=message):
        simulate(changed, {"n": value})


@pytest.mark.parametrize(
    ("signal", "message"),
    [
        (Signal((0.0,), (2.0,), "constant"), "u = 2: .*one of 1 = Off, 7 = On"),
        (Signal((0.0, 1.0), (1.0, 7.0), "linear"), "cannot have linear"),
    ],
)
def test_what_is_searched_has_values_of_its_type(signal: Signal, message: str) -> None:
    problem = lag_problem()
    assert isinstance(problem.model, FunctionModel)
    items = {"Off": 1, "On": 7}
    others = [v for v in problem.info.variables if v.name != "u"]
    info = replace(problem.info, variables=(*others, Variable("u", "enumeration", "input", literals=items)))
    ranged = InputRange("u", 1, 7, kind="enumeration", items=tuple(items.items()), interpolation="constant")
    changed = replace(
        problem, model=replace(problem.model, info=info), space=SearchSpace((ranged,), (), 10.0)
    )
    with pytest.raises(CandidateError, match=message):
        evaluate(changed, Candidate({"u": signal}))
