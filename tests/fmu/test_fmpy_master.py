"""Whole simulations are compared in tests/counterexamples/export/test_system_script.py."""

from pathlib import Path
from typing import Any

import pytest

from falsifier.fmu.fmpy_master import Signal, read_inputs, simulate, typed
from tests.fmu.fixtures import FOLDER


def test_a_signal_is_held_or_followed_in_a_line_through_its_last_two_values() -> None:
    signal = Signal()
    signal.update(1.0, 0.0)
    assert signal.at(0.5, is_linear=True) == 1.0  # one value makes no line
    signal.update(7.0, 1.0)
    signal.update(3.0, 1.0)  # the same step again, as in a loop
    assert signal.tried == 7.0
    assert signal.at(1.5, is_linear=False) == 3.0
    assert signal.at(1.5, is_linear=True) == 4.0


def test_numbers_become_values_of_their_type() -> None:
    assert [typed("Int8", 1.6), typed("Boolean", 0.5), typed("Boolean", 0.4)] == [2, True, False]
    assert typed("String", "a") == "a"


def test_of_two_rows_at_one_time_the_input_has_the_second(tmp_path: Path) -> None:
    file = tmp_path / "input.csv"
    file.write_text('"time","u"\n0.0,0.0\n1.0,4.0\n1.0,6.0\n2.0,6.0\n')
    inputs = read_inputs(file, ["u"], {"steps": 4, "stop_time": 2.0})
    assert [inputs(k)["u"] for k in range(5)] == [0.0, 2.0, 6.0, 6.0, 6.0]


@pytest.mark.parametrize(("gain", "converges"), [(0.5, True), (2.0, False)])
def test_a_controller_that_measures_itself_converges_if_its_gain_is_below_1(
    gain: float, converges: bool
) -> None:
    """y = k (r - y) with r = 1."""
    controller: dict[str, Any] = {
        "fmu": "Gain_2.fmu",
        "fmi": 2,
        "token": "{Gain_2}",
        "identifier": "Gain",
        "event_mode": False,
        "every": 1,
        "variables": {name: ("Real", k, 0, 1) for k, name in enumerate(("r", "measured", "y", "k"))},
        "arrays": {},
        "start": {"k": gain},
        "inputs": {"measured": {"from": "pi.y", "factor": 1.0, "offset": 0.0, "value": 0.0, "linear": False}},
        "held": [],
        "outputs": ["y"],
    }
    system: dict[str, Any] = {
        "stop_time": 1.0,
        "steps": 2,
        "every": 1,
        "tolerance": None,
        "method": "gauss-seidel",
        "convergence": 1e-9,
        "max_rounds": 50,
        "loops": {0: 1},
        "components": {"pi": controller},
        "columns": [],
        "recorded": {"pi.y": ("pi", "y")},
    }
    if converges:
        rows = simulate(system, FOLDER)
        assert [row[1] for row in rows] == pytest.approx([1 / 3] * 3)
    else:
        with pytest.raises(SystemExit, match="the initialisation does not converge"):
            simulate(system, FOLDER)
