"""The FMI runtime: state, reset, several instances, model exchange, errors."""

import subprocess
import sys

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from falsifier.core.experiment import Experiment
from falsifier.fmu import FmuModel
from tests.modelica.conftest import Build
from tests.modelica.exporter import ROOT
from tests.modelica.support import INTERFACES, opened, said_on_failure

AT = ROOT / "fmus" / "AT.fmu"


def test_reset_gives_the_same_run_again() -> None:
    with opened(AT) as [fmu]:
        first = fmu.start(throttle=80).run(["speed", "rpm", "gear"], 10, 0.01)
        fmu.fmu.reset()
        second = fmu.start(throttle=80).run(["speed", "rpm", "gear"], 10, 0.01)
    assert np.array_equal(first, second)
    assert first[-1, 3] > 1


@pytest.mark.parametrize("serialized", [False, True])
def test_state_can_be_saved_and_restored(serialized: bool) -> None:
    with opened(AT, 2) as [one, two]:
        one.start(throttle=90).run(["speed"], 5, 0.01)
        saved = one.fmu.getFMUState()
        expected = one.run(["speed", "rpm", "gear"], 12, 0.01)
        target = two.start(throttle=10) if serialized else one
        if serialized:
            saved = target.fmu.deSerializeFMUstate(one.fmu.serializeFMUState(saved), None)
        target.fmu.setFMUState(saved)
        target.time = 5.0
        assert np.array_equal(target.run(["speed", "rpm", "gear"], 12, 0.01), expected)
        target.fmu.freeFMUState(saved)


def test_instances_do_not_disturb_each_other() -> None:
    with opened(AT, 3) as instances:
        for k, fmu in enumerate(instances):
            fmu.start(throttle=40.0 * k)
        for _ in range(300):
            for fmu in instances:
                fmu.step(0.01)
        together = [fmu.row(["speed", "rpm", "gear"]) for fmu in instances]
    for k, row in enumerate(together):
        with opened(AT) as [alone]:
            expected = alone.start(throttle=40.0 * k).run(["speed", "rpm", "gear"], 3, 0.01)[-1, 1:]
            assert row == pytest.approx(expected, rel=1e-9)


def test_the_size_of_communication_steps_does_not_matter() -> None:
    results = []
    for size in (0.01, 0.05, 0.25, 0.02):
        with opened(AT) as [fmu]:
            results.append(fmu.start(throttle=77).run(["speed", "rpm", "gear"], 20, size)[-1, 1:])
    for other in results[1:]:
        assert other == pytest.approx(results[0], rel=1e-9)


@pytest.mark.parametrize(
    ("model", "names", "stop"),
    [
        ("Ball", ["h", "bounces"], 3.0),
        ("Thermostat", ["x", "switches"], 5.0),
        ("Counter", ["ticks", "held", "late"], 2.0),
        ("Times", ["early", "stairs", "whole"], 1.0),
        ("Starts", ["sum", "mode", "d"], 1.0),
    ],
)
def test_model_exchange_agrees_with_co_simulation(
    build: Build, model: str, names: list[str], stop: float
) -> None:
    experiment = Experiment(stop, 0.0125, tuple(names))
    found = []
    for interface in INTERFACES:
        fmu = FmuModel(build(model), interface)
        rows = fmu.simulate({}, {}, experiment)
        found.append(np.column_stack([rows[name] for name in names]))
        fmu.close()
    inside = np.all(np.isclose(found[0], found[1], atol=1e-6, rtol=1e-6), axis=1)
    # An event that falls on a row to the last digit may come in this row or in the next.
    assert np.count_nonzero(~inside) <= 2
    assert inside[-1]


def test_ticks_between_two_steps_see_the_new_input(build: Build) -> None:
    with opened(build("Sampler")) as [fmu]:
        rows = fmu.start().run(["x"], 1, 0.1, lambda t: {"u": 1 + round(10 * t)})
    assert rows[:, 1] == pytest.approx([0.1 * sum(range(1, k + 1)) for k in range(11)])


def test_but_not_where_they_have_been_seen_already(build: Build) -> None:
    with opened(build("SeenSampler")) as [fmu]:
        rows = fmu.start().run(["x", "seen"], 1, 0.1, lambda t: {"u": 1 + round(10 * t)})
    assert np.array_equal(rows[:, 2], range(1, 12))
    # The tick at the start is repeated with the first input, each later one has that of the step it ends.
    assert rows[:, 1] == pytest.approx([0, *(0.1 * (1 + sum(range(1, k + 1))) for k in range(10))])


def test_events_without_end_are_an_error(build: Build) -> None:
    assert "the events never end" in said_on_failure(build("Chatter"), ("x",))


def test_values_of_the_initial_system_can_be_read_and_starts_set_again(build: Build) -> None:
    with opened(build("Starts")) as [fmu]:
        fmu.fmu.setupExperiment(startTime=0.0)
        fmu.fmu.enterInitializationMode()
        assert fmu.get("sum") == pytest.approx(3 + 6 + 6)
        fmu.set({"p": 1})
        assert fmu.get("sum") == pytest.approx(2 + 2 + 6)
        fmu.fmu.exitInitializationMode()
        assert fmu.get("sum") == pytest.approx(2 + 2 + 6)


def test_fixed_parameters_and_outputs_cannot_be_set_during_simulation(build: Build) -> None:
    with opened(build("Decay")) as [fmu]:
        fmu.start()
        fmu.set({"k": 3.0, "u": 0.5})
        for name in ("x0", "y", "twice"):
            with pytest.raises(FMICallException):
                fmu.set({name: 1.0})


def test_thousands_of_instances_and_runs_leave_no_memory_behind() -> None:
    program = f"""
import resource, sys
sys.path.insert(0, {str(ROOT)!r})
from pathlib import Path
from tests.modelica.support import opened
def peak(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
with opened(Path({str(AT)!r})) as [fmu]:
    def cycle(n):
        for _ in range(n):
            fmu.fmu.reset(); fmu.start(throttle=50); fmu.step(0.01); fmu.get("speed")
            fmu.fmu.freeFMUState(fmu.fmu.getFMUState())
    cycle(500); before = peak(); cycle(5000); print(peak() - before)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert int(done.stdout.split()[-1]) < 2000  # kB
