"""The bundled automatic transmission against golden figures: an independent integration, publications."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from tests.modelica.conftest import ROOT, Build
from tests.modelica.support import Exchange, Floats, Inputs, opened

FMU = ROOT / "fmus" / "AT.fmu"
GOLDEN: dict[str, Any] = json.loads((ROOT / "tests" / "fixtures" / "at_golden.json").read_text())
NAMES = ["speed", "rpm", "gear"]
STOP, STEP = 50.0, 0.01


def signals(case: dict[str, Any], hold: float | None) -> Inputs:
    """pchip through evenly spaced control points, held for some time or continuous."""
    curves = {
        name: PchipInterpolator(np.linspace(0, STOP, len(case[name])), case[name])
        for name in ("throttle", "brake")
    }
    if hold is None:
        return lambda t: {name: float(curve(min(t, STOP))) for name, curve in curves.items()}
    grid = np.arange(round(STOP / hold) + 1) * hold
    tables = {name: curve(grid) for name, curve in curves.items()}
    return lambda t: {name: float(table[int(t / hold + 1e-6)]) for name, table in tables.items()}


def held(case: dict[str, Any], path: Path = FMU) -> Floats:
    with opened(path) as [fmu]:
        inputs = signals(case, 0.05)
        return fmu.start(**inputs(0)).run(NAMES, STOP, STEP, inputs)


def continuous(case: dict[str, Any]) -> Floats:
    with opened(FMU, exchange=True) as [fmu]:
        return Exchange(fmu, signals(case, None)).start().run(NAMES, STOP, STEP)


def shifts(rows: Floats) -> list[list[float]]:
    changes = np.flatnonzero(np.diff(rows[:, 3])) + 1
    return [[round(float(rows[k, 0]), 6), float(rows[k, 3])] for k in changes]


def robustness(rows: Floats) -> dict[str, float]:
    """The requirements of the transmission, straight from their definitions on the 0.01 s grid."""
    _, speed, rpm, gear = rows.T

    def until(seconds: float) -> int:
        return round(seconds / STEP) + 1

    calm = rpm[: until(30)].max() - 3000
    found = {"AT1": 120 - speed[: until(20)].max(), "AT2": 4750 - rpm[: until(10)].max()}
    for name, limit, end in (("AT6a", 35, 4), ("AT6b", 50, 8), ("AT6c", 65, 20)):
        found[name] = max(calm, limit - speed[: until(end)].max())
    changes = np.flatnonzero(np.diff(gear)) + 1
    for number in (1, 2, 3, 4):
        short = any(
            gear[a] == number and (a - 1) * STEP <= 30 and (b - a) * STEP <= 2.5 + 1e-9
            for a, b in pairwise(changes)
        )
        found[f"AT5{number}"] = -0.5 if short else 0.5
    return found


def check_run(rows: Floats, case: dict[str, Any], kind: str) -> None:
    golden = case[kind]
    assert shifts(rows) == golden["shifts"]
    at = np.rint(np.array(case["time"]) / STEP).astype(int)
    assert rows[at, 1] == pytest.approx(np.array(golden["speed"]), abs=1e-3)
    assert rows[at, 2] == pytest.approx(np.array(golden["rpm"]), abs=0.2)
    assert np.array_equal(rows[at, 3], golden["gear"])
    assert rows[:2001, 1].max() == pytest.approx(golden["max_speed_20"], abs=1e-3)
    assert rows[:1001, 2].max() == pytest.approx(golden["max_rpm_10"], abs=0.2)
    assert rows[:3001, 2].max() == pytest.approx(golden["max_rpm_30"], abs=0.2)


@pytest.mark.parametrize("run", GOLDEN["runs"])
def test_runs_with_held_inputs(run: str) -> None:
    check_run(held(GOLDEN["runs"][run]), GOLDEN["runs"][run], "held")


@pytest.mark.parametrize("run", ["B", "E"])
def test_runs_with_continuous_inputs(run: str) -> None:
    check_run(continuous(GOLDEN["runs"][run]), GOLDEN["runs"][run], "continuous")


def test_published_figures() -> None:
    full = held(GOLDEN["runs"]["A"])
    assert 120 - full[:2001, 1].max() == pytest.approx(-0.2133, abs=1e-3)
    half = held(GOLDEN["runs"]["B"])
    assert 120 - half[:2001, 1].max() == pytest.approx(0.4187, abs=1e-3)
    assert half[833, 1] == pytest.approx(82.5, abs=0.05)
    assert half[5000, 1] == pytest.approx(81.5, abs=0.05)


@pytest.mark.parametrize("case", GOLDEN["falsifying"], ids=lambda case: case["requirement"])
def test_falsifying_samples(case: dict[str, Any]) -> None:
    rows = held(case)
    assert robustness(rows)[case["requirement"]] == pytest.approx(case["held"], abs=5e-3)
    assert [shift for shift in shifts(rows) if shift[0] <= 33] == case["shifts"]


def test_idle_and_full_brake() -> None:
    idle = held({"throttle": [0, 0], "brake": [0, 0]})
    assert idle[[100, 500, 1000, 5000], 1] == pytest.approx([1.7038, 4.7211, 5.2456, 5.2787], abs=1e-3)
    assert idle[1000:, 2] == pytest.approx(np.full(4001, 600.0), abs=1e-6)
    stopped = held({"throttle": [0, 0], "brake": [325, 325]})
    assert np.abs(stopped[:, 1]).max() < 0.16


def test_parameters_can_be_tuned_on_the_way() -> None:
    with opened(FMU) as [fmu]:
        fmu.start(throttle=50)
        fmu.run(["speed"], 5, STEP)
        before = fmu.get("speed")
        fmu.set({"rollingLoad": 1000})
        for _ in range(100):
            fmu.step(STEP)
        assert fmu.get("speed") < before


def test_a_rebuilt_fmu_gives_the_same_trajectories(build: Build) -> None:
    rebuilt = build("ArchComp.AT", ROOT / "modelica" / "ArchComp")
    case = GOLDEN["runs"]["C"]
    assert np.array_equal(held(case, rebuilt), held(case))


def test_fmi_3_gives_the_same_trajectories() -> None:
    from fmpy import simulate_fmu

    case = GOLDEN["runs"]["E"]
    inputs = signals(case, 0.05)
    times = np.arange(5001) * STEP
    table = np.array(
        [(t, *inputs(t).values()) for t in times],
        dtype=[("time", float), ("throttle", float), ("brake", float)],
    )
    rows = simulate_fmu(
        str(ROOT / "fmus" / "AT_fmi3.fmu"),
        stop_time=STOP, output_interval=STEP, input=table, output=NAMES, fmi_type="CoSimulation",
    )  # fmt: skip
    expected = held(case)
    for k, name in enumerate(NAMES):
        assert np.asarray(rows[name]) == pytest.approx(expected[:, k + 1], rel=1e-9)
