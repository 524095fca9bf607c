from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory, is_discrete
from falsifier.errors import MonitorError

TIMES = np.linspace(0, 1, 11)
TRAJECTORY = Trajectory(TIMES, {"x": TIMES**2, "y": -TIMES}, {"x": "m"})


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
