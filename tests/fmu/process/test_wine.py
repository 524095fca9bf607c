"""Windows libraries through Wine give what the libraries for Linux give, errors included."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.model import Interface
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.errors import ModelError, SimulationError
from falsifier.fmu import FmuModel, read_info
from falsifier.fmu.description import libraries
from tests.command import ROOT
from tests.fixtures.fmus.catalogue import FIXTURES, WINDOWS
from tests.fmu import fixtures
from tests.fmu.fixtures import ME, run
from tests.fmu.support import CRASH, DISCARD, END, ERROR, EXIT, HANG, commit
from tests.hostile.test_model_exchange import MISDEEDS

needs_wine = pytest.mark.skipif(
    libraries.find_wine() is None or not libraries.can_run_windows(),
    reason=f"Windows libraries are not simulated here; {libraries.HOW_TO_INSTALL}",
)
FOLDER = fixtures.FOLDER / "win64"
INTERFACES: dict[str, Interface] = {"CoSimulation": "co-simulation", "ModelExchange": "model-exchange"}
# Interfaces of the test FMUs; those that fail on purpose are tested below.
CASES = [
    (fixture.file, INTERFACES[name])
    for fixture in FIXTURES
    for name in fixture.interfaces
    if fixture.file in WINDOWS and fixture.name not in ("Misdeeds", "Table")
]
BUNDLED = sorted(path.name for path in (ROOT / "fmus").glob("*.fmu"))
# The others' model exchange is the same code with other equations.
EXCHANGED = ("AT_fmi3.fmu", "F16.fmu", "PulseMeter.fmu")


def through_wine(name: str, interface: Interface = "co-simulation") -> FmuModel:
    """A test FMU with a library for Windows only."""
    return FmuModel(FOLDER / f"{name}.fmu", interface)


def excited(model: FmuModel, stop: float) -> dict[str, Signal]:
    """A signal within the range of each input."""
    signals = {}
    for variable in model.info.inputs:
        low, high = variable.limits
        low, high = (0.0 if low is None else low), (1.0 if high is None else high)
        values = tuple(float(low + share * (high - low)) for share in (0.2, 0.9, 0.4, 0.6))
        kind = "pchip" if variable.kind == "real" else "constant"
        signals[variable.name] = Signal((0.0, 0.3 * stop, 0.7 * stop, stop), values, kind)  # type: ignore[arg-type]
    return signals


def trajectory(model: FmuModel, stop: float, samples: int = 100) -> Trajectory:
    """The second of two simulations, which starts from a used instance, and the same as the first."""
    outputs = [v.name for v in model.info.outputs if v.kind != "string"]
    experiment = Experiment(stop, stop / samples, tuple(outputs))
    signals = excited(model, stop)
    try:
        first, second = (model.simulate(signals, {}, experiment) for _ in range(2))
    finally:
        model.close()
    assert all(np.array_equal(first[name], second[name]) for name in outputs)
    return second


def apart(one: Trajectory, other: Trajectory) -> float:
    """Largest difference of two trajectories, relative to the largest value of each variable."""
    assert one.names == other.names
    differences = [
        float(np.abs(one[name] - other[name]).max() / max(np.abs(other[name]).max(), 1e-9))
        for name in one.names
    ]
    return max(differences)


@needs_wine
@pytest.mark.parametrize(("name", "interface"), CASES)
def test_windows_libraries_give_the_trajectories_of_the_others(name: str, interface: Interface) -> None:
    expected = trajectory(fixtures.isolated(name, interface), 3.0)
    assert apart(trajectory(through_wine(name, interface), 3.0), expected) < 1e-12


@needs_wine
@pytest.mark.parametrize(
    ("name", "interface"),
    [*((name, "co-simulation") for name in BUNDLED), *((name, ME) for name in EXCHANGED)],
)
def test_the_bundled_windows_libraries_are_verified(name: str, interface: Interface) -> None:
    path = ROOT / "fmus" / name
    stop = (read_info(path).stop_time or 10.0) / 10
    expected = trajectory(FmuModel(path, interface), stop)
    assert apart(trajectory(FmuModel(path, interface, windows=True), stop), expected) < 1e-12


@pytest.fixture(scope="module")
def misdeeds() -> Iterator[FmuModel]:
    model = through_wine("Misdeeds_2")
    yield model
    model.close()


@needs_wine
@pytest.mark.parametrize("misdeed", [CRASH, EXIT, DISCARD, END, ERROR])
def test_errors_are_those_of_the_other_libraries(misdeeds: FmuModel, misdeed: int) -> None:
    expected, got = commit(fixtures.isolated("Misdeeds_2"), misdeed), commit(misdeeds, misdeed)
    assert (str(got), got.status, got.time, got.log) == (
        str(expected),
        expected.status,
        expected.time,
        expected.log,
    )


# The solver's errors: a step that fails, a status that FMI does not define, numbers written past the end of
# an array, events without end, and the FMU's wish to end.
@needs_wine
@pytest.mark.parametrize("misdeed", ["not a number", "odd status", "long indicators", "dense events", "end"])
def test_errors_of_model_exchange_are_the_same_too(misdeed: str) -> None:
    said = []
    for model in (fixtures.isolated("Wild_2", ME), through_wine("Wild_2", ME)):
        with pytest.raises(SimulationError) as caught:
            run(model, ("x",), parameters={"misdeed": list(MISDEEDS).index(misdeed)})
        said.append((str(caught.value), caught.value.status, caught.value.time))
        model.close()
    assert said[0] == said[1] and MISDEEDS[misdeed] in said[0][0]


@needs_wine
def test_a_hang_is_stopped_and_the_next_simulation_runs_in_a_new_process(misdeeds: FmuModel) -> None:
    run(misdeeds, ("y",))
    assert commit(misdeeds, HANG, time_limit=0.3).status == "timeout"


def test_without_wine_the_message_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda _: None)
    if not libraries.can_run_windows():
        pytest.skip("Windows libraries are not simulated on this machine, with or without Wine")
    model = FmuModel(FOLDER / "Lag_2.fmu")
    with pytest.raises(
        ModelError,
        match=r"Lag_2\.fmu: its library runs through Wine, which is missing: .*apt-get install wine64",
    ):
        run(model, ("y",))


def test_the_windows_library_of_an_fmu_without_one_is_refused() -> None:
    with pytest.raises(ModelError, match=r"Lag_2\.fmu: the FMU has no library for x86_64-windows, only "):
        FmuModel(fixtures.path("Lag_2"), windows=True)


@needs_wine
def test_a_library_that_is_none_is_refused(tmp_path: Path) -> None:
    good, broken = FOLDER / "Lag_2.fmu", tmp_path / "broken.fmu"
    fixtures.altered(good, broken, lambda _: b"nothing", ending=".dll")
    with pytest.raises(ModelError, match="the library cannot be loaded: it is not a 64-bit library"):
        run(FmuModel(broken), ("y",))
