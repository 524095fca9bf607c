"""The project's own small FMUs (tests/fixtures/fmus) and what is done with them again and again."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final
from zipfile import ZipFile

from falsifier.core.experiment import Experiment
from falsifier.core.model import Interface
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.fmu import FmuModel, System
from falsifier.fmu.process.registry import REGISTRY
from falsifier.fmu.process.runner import Runner
from falsifier.fmu.process.worker import Worker
from tests.patience import HANG

# How a model-exchange FMU is simulated, for type checkers.
ME: Final = "model-exchange"
FOLDER = Path(__file__).parents[1] / "fixtures" / "fmus"


def path(name: str) -> Path:
    """Path of a test FMU, e.g. ``Lag_2``."""
    return FOLDER / f"{name}.fmu"


def altered(fmu: Path, target: Path, change: Callable[[bytes], bytes], *, ending: str = "") -> Path:
    """A copy of an FMU in which the files whose names end so have other contents."""
    with ZipFile(fmu) as known, ZipFile(target, "w") as copy:
        for name in known.namelist():
            content = known.read(name)
            copy.writestr(name, change(content) if name.endswith(ending) else content)
    return target


def isolated(name: str, interface: Interface = "co-simulation") -> FmuModel:
    return FmuModel(path(name), interface)


def runners(model: FmuModel | System) -> list[Runner]:
    """What simulates a model in this process, in each thread that has simulated it."""
    return [runner for (key, _), runner in REGISTRY._runners.items() if key == model.order.key]


def runner(model: FmuModel) -> Runner:
    """What simulates a model in this thread."""
    (found,) = runners(model)
    return found


def worker(model: FmuModel) -> Worker:
    """The process in which a model is simulated."""
    found = runner(model)._worker
    assert found is not None
    return found


def run(
    model: FmuModel | System,
    outputs: Sequence[str],
    *,
    stop: float = 1.0,
    interval: float = 0.1,
    signals: Mapping[str, Signal] | None = None,
    parameters: Mapping[str, float] | None = None,
    step_size: float | None = None,
    tolerance: float | None = None,
    time_limit: float = HANG,
) -> Trajectory:
    experiment = Experiment(stop, interval, tuple(outputs), step_size, tolerance, time_limit)
    return model.simulate(signals or {}, parameters or {}, experiment)


def ramp(stop: float, slope: float = 1.0) -> Signal:
    return Signal((0.0, stop), (0.0, slope * stop), "linear")
