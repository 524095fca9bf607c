"""The bundled automatic transmission against golden figures: an independent integration, publications."""

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.trajectory import Trajectory
from falsifier.fmu import FmuModel
from tests.systems.driving import ROOT, Array, evenly, golden, robustness

GOLDEN = golden("AT")
NAMES = ("speed", "rpm", "gear")
STOP, STEP = 50.0, 0.01
FMU = ROOT / "fmus" / "AT.fmu"
Kind = Literal["held", "continuous"]


def driven(case: dict[str, Any], kind: Kind = "held") -> Trajectory:
    """Simulate with pchip inputs: held for 0.05 s by co-simulation, or continuous by model exchange."""
    inputs = {name: evenly(case[name], STOP) for name in ("throttle", "brake")}
    if kind == "held":
        inputs = {name: replace(signal, hold=0.05) for name, signal in inputs.items()}
    model = FmuModel(FMU, "co-simulation" if kind == "held" else "model-exchange")
    found = model.simulate(inputs, {}, Experiment(STOP, STEP, NAMES))
    model.close()
    return found


def shifts(gear: Array) -> list[list[float]]:
    changes = np.flatnonzero(np.diff(gear)) + 1
    return [[round(k * STEP, 6), float(gear[k])] for k in changes]


@pytest.mark.parametrize(
    ("run", "kind"), [*((run, "held") for run in GOLDEN["runs"]), ("B", "continuous"), ("E", "continuous")]
)
def test_golden_runs(run: str, kind: Kind) -> None:
    case = GOLDEN["runs"][run]
    golden, found = case[kind], driven(case, kind)
    speed, rpm, gear = (found[name] for name in NAMES)
    assert shifts(gear) == golden["shifts"]
    at = np.rint(np.array(case["time"]) / STEP).astype(int)
    assert speed[at] == pytest.approx(np.array(golden["speed"]), abs=1e-3)
    assert rpm[at] == pytest.approx(np.array(golden["rpm"]), abs=0.2)
    assert np.array_equal(gear[at], golden["gear"])
    assert speed[:2001].max() == pytest.approx(golden["max_speed_20"], abs=1e-3)
    assert rpm[:1001].max() == pytest.approx(golden["max_rpm_10"], abs=0.2)
    assert rpm[:3001].max() == pytest.approx(golden["max_rpm_30"], abs=0.2)


def test_published_figures() -> None:
    full, half = (driven(GOLDEN["runs"][run])["speed"] for run in "AB")
    assert 120 - full[:2001].max() == pytest.approx(-0.2133, abs=1e-3)
    assert 120 - half[:2001].max() == pytest.approx(0.4187, abs=1e-3)
    assert half[[833, 5000]] == pytest.approx([82.5, 81.5], abs=0.05)


@pytest.mark.parametrize("case", GOLDEN["falsifying"], ids=lambda case: case["requirement"])
def test_falsifying_samples(case: dict[str, Any]) -> None:
    found = driven(case)
    columns = {name: found[name] for name in NAMES}
    measured = robustness(case["requirement"], "AT", columns, stop_time=STOP)
    assert measured == pytest.approx(case["held"], abs=5e-3)
    assert [shift for shift in shifts(found["gear"]) if shift[0] <= 33] == case["shifts"]


def test_idle_and_full_brake() -> None:
    idle = driven({"throttle": [0, 0], "brake": [0, 0]})
    assert idle["speed"][[100, 500, 1000, 5000]] == pytest.approx([1.7038, 4.7211, 5.2456, 5.2787], abs=1e-3)
    assert idle["rpm"][1000:] == pytest.approx(np.full(4001, 600.0), abs=1e-6)
    assert np.abs(driven({"throttle": [0, 0], "brake": [325, 325]})["speed"]).max() < 0.16
