"""delay and spatialDistribution: values, jumps, short delays, saved states, both interfaces."""

from math import factorial

import numpy as np
import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.model import Interface
from falsifier.core.signals import Signal
from falsifier.fmu import FmuModel
from tests.modelica.conftest import Build
from tests.modelica.support import INTERFACES, Floats, Instance, opened, said_on_failure

STOP, STEP = 2.0, 0.01
NAMES = ("x", "late", "ramp", "steps", "varying", "crossings")
TIMES = np.linspace(0, STOP, 201)
INPUT = Signal((0.0, 0.5, 1.2), (1.0, 3.0, -2.0), "constant")


def simulated(
    build: Build, model: str, names: tuple[str, ...], interface: Interface, fmi: int = 2, **values: float
) -> dict[str, Floats]:
    fmu = FmuModel(build(model, fmi=fmi), interface=interface)
    found = fmu.simulate({"u": INPUT}, values, Experiment(STOP, STEP, names))
    fmu.close()
    return {name: np.asarray(found[name]) for name in names}


def delayed_decay(delay: float) -> Floats:
    """Solve x'(t) = -x(t - delay), with x = 1 until t = 0, by the method of steps."""
    ages = TIMES[:, np.newaxis] - delay * np.arange(-1, 40)
    terms = [(-1) ** k * np.maximum(ages[:, k], 0) ** k / factorial(k) for k in range(1, 41)]
    return np.asarray(1 + np.sum(terms, axis=0))


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("interface", INTERFACES)
@pytest.mark.parametrize("delay", [0.3, 0.1])
def test_delays(build: Build, interface: Interface, fmi: int, delay: float) -> None:
    found = simulated(build, "Delays", NAMES, interface, fmi, T=delay)
    # Values between points of the line are interpolated linearly; the error depends on the solver's step.
    tolerance = 2e-6 if interface == "co-simulation" else 1e-4
    assert found["x"] == pytest.approx(delayed_decay(delay), abs=tolerance)
    assert found["ramp"] == pytest.approx(np.maximum(TIMES - delay, 0), abs=1e-12)
    back = 0.5 * (0.6 + 0.4 * np.cos(3 * TIMES))
    assert found["varying"] == pytest.approx(np.maximum(TIMES - back, 0), abs=1e-9)
    passed = np.round(TIMES - delay, 9)
    clear = ~np.isin(passed, [0.5, 1.2])  # a row at a jump may show either side
    assert np.array_equal(found["late"][clear], INPUT.sample(np.maximum(passed, 0))[clear])
    clear = np.abs(np.round(10 * passed) - 10 * passed) > 1e-6
    assert np.array_equal(found["steps"][clear], np.floor(10 * np.maximum(passed[clear], 0)))
    assert np.array_equal(found["crossings"], passed > 0.255)


@pytest.mark.parametrize("interface", INTERFACES)
def test_a_delay_shorter_than_a_step_makes_steps_shorter(build: Build, interface: Interface) -> None:
    found = simulated(build, "Delays", ("x", "ramp"), interface, T=0.0007)
    assert found["ramp"] == pytest.approx(np.maximum(TIMES - 0.0007, 0), abs=1e-12)
    # x' = -x(t - T) has the solution exp(-r t) with r exp(-r T) = 1 after a short while.
    rate = 1.0
    for _ in range(50):
        rate = np.exp(rate * 0.0007)
    assert found["x"][-1] / found["x"][100] == pytest.approx(np.exp(-rate), rel=1e-6)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("interface", INTERFACES)
def test_transport_at_a_varying_speed(build: Build, interface: Interface, fmi: int) -> None:
    names = ("way", "inlet", "outlet", "smooth")
    found = simulated(build, "Pipe", names, interface, fmi)
    fine = np.linspace(0, STOP, 400001)
    ways = 2 + 2 * fine + 1 - np.cos(fine)
    assert found["way"] == pytest.approx(ways[::2000], abs=1e-8)
    clear = ~np.isin(np.round(TIMES, 9), [0.5, 1.2])
    assert np.array_equal(found["inlet"][clear], INPUT.sample(TIMES[clear]))
    entered = np.interp(found["way"] - 1, ways, fine)
    flowing = found["way"] >= 3
    assert found["smooth"][flowing] == pytest.approx(np.cos(entered[flowing]), abs=1e-4)
    assert np.all(found["smooth"][found["way"] < 3] == 0)
    # The initial profile leaves the pipe from its end: 7, then down to 5 and 1.
    place = 3 - found["way"][~flowing]
    assert found["outlet"][~flowing] == pytest.approx(np.interp(place, [0, 0.5, 1], [1, 5, 7]), abs=1e-9)
    clear = flowing & (np.abs(entered - 0.5) > 1e-3) & (np.abs(entered - 1.2) > 1e-3) & (entered > 1e-3)
    assert np.array_equal(found["outlet"][clear], INPUT.sample(entered[clear]))


def rows_from(fmu: Instance, start: float, stop: float) -> Floats:
    """Return rows of a running instance between two times, with a varying input."""
    fmu.time = start
    return fmu.run(NAMES, stop, STEP, lambda t: {"u": round(100 * t) % 7})


@pytest.mark.parametrize("serialized", [False, True])
def test_a_saved_state_has_what_is_in_the_delays(build: Build, serialized: bool) -> None:
    with opened(build("Delays"), 2) as [one, two]:
        one.start()
        rows_from(one, 0.0, 0.87)
        saved = one.fmu.getFMUState()
        expected = rows_from(one, 0.87, STOP)
        target = one
        if serialized:
            target = two.start(T=0.05)
            rows_from(two, 0.0, 1.5)
            saved = two.fmu.deSerializeFMUstate(one.fmu.serializeFMUState(saved), None)
        for _ in range(2):
            target.fmu.setFMUState(saved)
            assert np.array_equal(rows_from(target, 0.87, STOP), expected)
        target.fmu.freeFMUState(saved)


def test_values_at_the_start_are_those_of_the_initial_system(build: Build) -> None:
    with opened(build("Delays")) as [fmu]:
        fmu.fmu.setupExperiment(startTime=0.0)
        fmu.fmu.enterInitializationMode()
        fmu.set({"u": 5.0})
        assert fmu.row(["late", "ramp"]) == [5, 0]
        fmu.set({"u": 6.0})
        fmu.fmu.exitInitializationMode()
        assert fmu.row(["late", "ramp"]) == [6, 0]
        fmu.set({"u": -1.0})
        fmu.step(0.2)
        assert fmu.get("late") == 6
        fmu.step(0.2)
        assert fmu.get("late") == -1


@pytest.mark.parametrize(
    ("model", "values", "reason"),
    [
        ("Delays", {"T": 0.0}, "the delay must be longer than 0"),
        ("Delays", {"T": -1.0}, "the delay must be longer than 0"),
        ("Delays", {"longest": -0.1}, "the delay must be longer than 0"),
        ("Delays", {"stretch": 3.0}, "the delay is longer than 'delayMax'"),
        ("Delays", {"stretch": -1.0}, "a delay time is negative"),
        ("Pipe", {"speed": -2.0}, "'x' of spatialDistribution decreases"),
        ("Pipe", {"speed": 0.3}, "the delay needs more points than __falsifier_solver(delayPoints) provides"),
    ],
)
def test_impossible_delays_stop_the_simulation(
    build: Build, model: str, values: dict[str, float], reason: str
) -> None:
    said = said_on_failure(build(model), ("x",) if model == "Delays" else ("way",), **values)
    assert reason in said
    assert f"{model}.mo:" in said or "negative" in reason
