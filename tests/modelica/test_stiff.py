"""The implicit method: stiff equations with known solutions."""

from __future__ import annotations

import zipfile

import numpy as np
import pytest

from falsifier.core.model import Experiment
from falsifier.fmu import FmuModel
from tests.modelica.conftest import Build
from tests.modelica.support import Floats

NAMES = ("follower", "level", "slow", "echo", "turns")
TIMES = np.linspace(0, 6, 61)


def simulated(
    build: Build, tolerance: float, *, exchange: bool = False, **values: float
) -> dict[str, Floats]:
    fmu = FmuModel(build("Stiff"), interface="model-exchange" if exchange else "co-simulation")
    found = fmu.simulate({}, values, Experiment(6.0, 0.1, NAMES, tolerance=tolerance))
    fmu.close()
    return {name: np.asarray(found[name]) for name in NAMES}


def echo() -> Floats:
    """Return what follows 1 until 0.5 s, then cos(t - 0.5), with a rate of 50 / s."""
    late = np.maximum(TIMES - 0.5, 0)
    start = 1 - np.exp(-50 * np.minimum(TIMES, 0.5))
    # e' = 50 (cos(s) - e), e(0) = start: the stationary part is a sine and a cosine.
    cosine, sine = 2500 / 2501, 50 / 2501
    driven = cosine * np.cos(late) + sine * np.sin(late)
    return np.asarray(np.where(TIMES < 0.5, start, driven + (start - cosine) * np.exp(-50 * late)))


@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("rate", [1e3, 1e6])
def test_stiff_equations(build: Build, tolerance: float, rate: float) -> None:
    found = simulated(build, tolerance, rate=rate)
    assert found["follower"] == pytest.approx(np.cos(TIMES), abs=20 * tolerance)
    assert found["slow"] == pytest.approx(np.exp(-TIMES), abs=20 * tolerance)
    assert np.array_equal(found["turns"], np.minimum(np.floor(TIMES / np.log(2)), 3))
    assert found["echo"] == pytest.approx(echo(), abs=100 * tolerance)
    if rate == 1e6:
        # The level is where inflow and outflow balance, apart from the slow decay of the inflow.
        assert found["level"][1:30] == pytest.approx((0.1 * np.exp(-TIMES[1:30])) ** 2, rel=1e-3)


def test_the_other_interface_has_the_same_solution(build: Build) -> None:
    one, other = simulated(build, 1e-9), simulated(build, 1e-9, exchange=True)
    for name in NAMES:
        assert one[name] == pytest.approx(other[name], abs=1e-4), name


def test_slopes_are_moved_in_groups(build: Build) -> None:
    with zipfile.ZipFile(build("Stiff")) as archive:
        sizes = archive.read("sources/sizes.h").decode()
        assert "sources/implicit.h" in archive.namelist()
        assert "sources/explicit.h" not in archive.namelist()
    assert "#define MODEL_STATES 4\n" in sizes
    assert "#define MODEL_GROUPS 2\n" in sizes
    assert "#define MODEL_SLOPES_OF_TIME 1\n" in sizes
