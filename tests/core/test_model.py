import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.core.experiment import Experiment
from falsifier.core.function_model import FunctionModel
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory, is_discrete
from falsifier.errors import ModelError, MonitorError, SimulationError, SpecError

INFO = ModelInfo(
    "tank",
    variables=(
        Variable("inflow", causality="input", unit="m3/s"),
        Variable("area", causality="parameter", start=2.0),
        Variable("level", causality="output", unit="m"),
        Variable("full", "boolean", "output"),
    ),
)
Floats = NDArray[np.float64]


def tank(times: Floats, inputs: dict[str, Floats], parameters: dict[str, float]) -> dict[str, Floats]:
    """Level of a tank: the integral of the inflow by the left rule."""
    step = float(times[1])
    level = np.concatenate([[0.0], np.cumsum(inputs["inflow"][:-1])]) * step / parameters.get("area", 2.0)
    return {"level": level, "full": (level > 1.0).astype(np.float64)}


def divide(times: Floats, inputs: dict[str, Floats], parameters: dict[str, float]) -> dict[str, Floats]:
    """An output that is inf at t = 0.5."""
    with np.errstate(divide="ignore"):
        return {"level": 1.0 / (times - 0.5), "full": times}


EXPERIMENT = Experiment(1.0, 0.1, ("level", "full"))
INFLOW = {"inflow": Signal((0.0,), (4.0,))}


def test_a_function_is_a_model() -> None:
    got = FunctionModel(tank, INFO).simulate(INFLOW, {"area": 1.0}, EXPERIMENT)
    assert got["level"][-1] == pytest.approx(4.0)
    assert got["full"].tolist() == [0.0] * 3 + [1.0] * 8
    assert got.units == {"level": "m"}
    with pytest.raises(SpecError, match="function: expected a function, got ModelInfo"):
        FunctionModel(INFO, tank)  # type: ignore[arg-type]
    both = replace(INFO, variables=(*INFO.variables, Variable("inflow", causality="output")))
    with pytest.raises(ModelError, match="tank: 'inflow' is an input and an output"):
        FunctionModel(tank, both)


@pytest.mark.parametrize(("given", "level"), [({}, 0.0), ({"inflow": 3.0, "area": 1.0}, 3.0)])
def test_an_input_without_a_signal_is_constant(given: dict[str, float], level: float) -> None:
    assert FunctionModel(tank, INFO).simulate({}, given, EXPERIMENT)["level"][-1] == pytest.approx(level)


@pytest.mark.parametrize(
    ("function", "outputs", "message"),
    [
        (divide, ("level",), "tank: output 'level' is inf at t = 0.5 s"),
        (lambda *_: 1 / 0, ("level",), "tank: ZeroDivisionError: division by zero"),
        (lambda *_: sys.exit("no licence"), ("level",), "tank: SystemExit: no licence"),
        (lambda times, *_: {"level": times[:-1]}, ("level",), r"'level' has shape \(10,\), expected \(11,\)"),
        (lambda t, *_: t.fill(0), ("level",), "tank: ValueError: .*read-only"),
        (lambda *_: None, ("level",), "the function returned NoneType; expected a dictionary"),
        (lambda *_: (1.0, 2.0), ("level",), "the function returned tuple; expected a dictionary"),
        (lambda *_: {"level": ["high"] * 11}, ("level",), "output 'level' is not an array of real numbers"),
        (lambda *_: {"level": [1j] * 11}, ("level",), "output 'level' is not an array of real numbers"),
        (tank, ("levle",), "the output 'levle'; did you mean 'level'"),
    ],
)
def test_what_goes_wrong_is_a_failed_simulation(
    function: object, outputs: tuple[str, ...], message: str
) -> None:
    model = FunctionModel(function, INFO)  # type: ignore[arg-type]
    with pytest.raises(SimulationError, match=message) as caught:
        model.simulate(INFLOW, {}, Experiment(1.0, 0.1, outputs))
    assert caught.value.status == "failed"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"stop_time": 0.0}, "stop_time: expected a positive number, got 0.0"),
        ({"output_interval": -0.1}, "output_interval: expected a positive number"),
        ({"output_interval": 0.3}, "not an integer multiple of output_interval = 0.3 s; try .* = 0.2$"),
        ({"output_interval": 2.0}, "not an integer multiple of output_interval = 2 s; try .* 1$"),
        ({"stop_time": 1e308, "output_interval": 1e-10}, "^output_interval: .* smallest value is 1e[+]301"),
        ({"step_size": 1e-320}, "^step_size: output_interval = 0.1 s has more than 10,000,000 times"),
        ({"step_size": 0.0}, "step_size: expected a positive number"),
        ({"step_size": 0.03}, "^step_size: .* try step_size = 0.02"),
        ({"step_size": 0.2}, "^step_size: .* try step_size = 0.1"),
        ({"time_limit": math.inf}, "time_limit: expected a finite number"),
        ({"outputs": "x"}, "outputs: expected a tuple of names, got 'x'"),
    ],
)
def test_an_experiment_that_cannot_be_run_is_refused_when_it_is_made(
    wrong: dict[str, Any], message: str
) -> None:
    right: dict[str, Any] = {"stop_time": 1.0, "output_interval": 0.1, "outputs": ("x",)}
    with pytest.raises(SpecError, match=message):
        Experiment(**right | wrong)


TIMES = np.linspace(0, 1, 11)
TRAJECTORY = Trajectory(TIMES, {"x": TIMES**2, "y": -TIMES}, {"x": "m"})


def test_internal_variables_are_the_first_states_and_modes_without_copies_and_what_tools_add() -> None:
    names = ("mode", "$whenCondition1", "plant.$whenCondition1", "plant._when", "plant.fed", "plant.mode")
    modes = [Variable(n, kind="boolean", variability="discrete") for n in names]
    others = [Variable("same", is_state=True, alias_of="x1"), Variable("level", variability="discrete")]
    many = [*(replace(modes[0], name=f"m{k}") for k in range(20)), *map(_state, range(20))]
    info = ModelInfo("plant", variables=(*modes, *others, *many), connections=(("mode", "plant.fed"),))
    found = [f"x{k}" for k in range(12)] + ["mode", "plant.mode"] + [f"m{k}" for k in range(10)]
    assert [v.name for v in info.internals] == found


def _state(number: int) -> Variable:
    return Variable(f"x{number}", is_state=True)


def test_saved_and_loaded_is_the_same(tmp_path: Path) -> None:
    TRAJECTORY.save(tmp_path / "t.npz")
    loaded = Trajectory.load(tmp_path / "t.npz")
    assert loaded.names == ("x", "y")
    assert loaded.units == {"x": "m"}
    assert loaded.times.tobytes() == TIMES.tobytes()
    assert loaded["x"].tobytes() == TRAJECTORY["x"].tobytes()


def test_missing_signals_and_unequal_lengths_are_named() -> None:
    with pytest.raises(MonitorError, match=r"no signal 'z'.*known: x, y"):
        TRAJECTORY["z"]
    with pytest.raises(MonitorError, match="'x' has 3 samples, expected 11 as in the time grid"):
        Trajectory(TIMES, {"x": np.zeros(3)})


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ([0.0, 1.0, 1.5], "got 1.5 s after 1 s as recorded time 2"),
        ([0.0, -1.0, -2.0], "got -1 s after 0 s as recorded time 1"),
        ([0.0, 0.0, 0.0], "got 0 s after 0 s as recorded time 1"),
        ([0.0, np.nan, 2.0], "got nan s after 0 s"),
        ([1.0, 2.0, 3.0], r"expected 0 s as the first one, got \[1.0\]"),
        ([], r"expected 0 s as the first one, got \[\]"),
        ([[0.0, 1.0], [2.0, 3.0]], r"times: expected an array of numbers of shape \(n,\)"),
        (["0", "1"], "times: expected an array of numbers"),
    ],
)
def test_times_that_are_no_grid_are_refused(times: list[float], said: str) -> None:
    with pytest.raises(MonitorError, match=said):
        Trajectory(np.array(times), {"x": np.array(times)})


def test_columns_that_are_no_numbers_are_refused() -> None:
    for column in (np.array(["a"] * 11), np.array([None] * 11), np.zeros((11, 2))):
        with pytest.raises(MonitorError, match="x: expected an array of numbers"):
            Trajectory(TIMES, {"x": column})


@pytest.mark.parametrize(("stop_time", "samples"), [(1e4, 1_000_001), (50.0, 20_001), (7.0, 3), (0.0, 1)])
def test_grids_of_simulations_are_taken(stop_time: float, samples: int) -> None:
    times = np.linspace(0.0, stop_time, samples)
    for each in (times, np.arange(samples, dtype=np.float64) * (stop_time / max(1, samples - 1))):
        assert len(Trajectory(each, {"x": each})) == samples


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        ("boolean", [0, 0], True),  # by its type
        ("real", [0, 0], False),  # nothing can be said of a constant
        ("real", [0, 3, 3], True),
        ("real", [0, 0.5], False),
        ("real", range(16), True),
        ("real", range(17), False),
    ],
)
def test_a_signal_is_discrete_by_its_type_or_by_its_values(
    kind: str, values: Sequence[float], expected: bool
) -> None:
    assert is_discrete(np.array(values, dtype=np.float64), kind=kind) is expected


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan, 2.5])
def test_no_integer_is_infinite_or_undefined(value: float) -> None:
    assert Variable("n", "integer").expected(value).startswith("expected an integer")


def test_slopes_that_no_number_can_state_leave_no_warning(recwarn: pytest.WarningsRecorder) -> None:
    assert len(Signal((0.0, 1.0), (1e308, -1e308), "linear").pieces(1.0)) == 2
    assert not recwarn.list
