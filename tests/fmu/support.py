"""Processes that simulate an FMU which misbehaves as it is told to."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from falsifier.errors import SimulationError
from falsifier.fmu import FmuModel
from falsifier.fmu.process.workplace import sweep
from tests import patience
from tests.command import listen_to_interrupts
from tests.fmu import fixtures

NOTHING, CRASH, HANG, EXIT, ALLOCATE, NAN, DISCARD, END, ABORT, ERROR, TALK, PRINT = range(12)

SCRIPT = """
import os, sys, time
from pathlib import Path
from falsifier.fmu import FmuModel
from falsifier.core.experiment import Experiment
model = FmuModel(sys.argv[1])
experiment = Experiment(1.0, 0.1, ("y",))
def go(misdeed=0):
    return model.simulate({}, {"misdeed": misdeed}, experiment)["y"][-1]
go(); go()
"""


def commit(model: FmuModel, misdeed: int, *, time_limit: float = patience.HANG) -> SimulationError:
    """The error of a simulation in which an FMU misbehaves, and after which the next one runs."""
    with pytest.raises(SimulationError) as caught:
        fixtures.run(model, ("y",), parameters={"misdeed": misdeed}, time_limit=time_limit)
    assert fixtures.run(model, ("y",))["y"].tolist() == list(range(11))
    return caught.value


def script(body: str, **environment: str) -> str:
    """Return what a process prints that simulates."""
    return python(SCRIPT + body, str(fixtures.path("Misdeeds_2")), **environment).stdout


def python(code: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a process of Python that finds what this one does."""
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment},
        preexec_fn=listen_to_interrupts,
        timeout=patience.HANG,
        check=False,
    )


def assert_nothing_is_left(folder: Path) -> None:
    """Wait until the folders of processes in this folder are gone or can be swept."""

    def is_empty() -> bool:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("tempfile.tempdir", str(folder))
            sweep()
        return not list(folder.glob("falsifier-fmu-*"))

    patience.wait_until(is_empty)
