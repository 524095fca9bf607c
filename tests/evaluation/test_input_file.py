from pathlib import Path

import numpy as np
import pytest

from falsifier.core.model import ModelInfo, Variable
from falsifier.errors import SpecError
from falsifier.evaluation.input_file import read_inputs

INFO = ModelInfo(
    "plant",
    variables=(
        Variable("u", causality="input"),
        Variable("gear", kind="integer", causality="input"),
        Variable("mode", kind="enumeration", causality="input", literals={"Off": 1, "Hill hold": 3}),
        Variable("=v", causality="input"),
        *(Variable(f"w[{i}]", causality="input") for i in (1, 2)),
        Variable("speed", causality="output"),
    ),
)


def written(folder: Path, text: str) -> Path:
    path = folder / "u.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_rows_are_joined_by_straight_lines_and_held_after_the_last(tmp_path: Path) -> None:
    found = read_inputs(written(tmp_path, "time,u\n0,0\n1,0\n2,4\n4,0\n"), INFO)
    assert found.signals["u"].sample(np.array([0.5, 1.5, 3.0, 9.0])) == pytest.approx([0, 2, 2, 0])
    assert found.end == 4


def test_a_repeated_time_is_a_step_with_the_later_value(tmp_path: Path) -> None:
    flat = read_inputs(written(tmp_path, "t,u\n0,1\n2,1\n2,5\n4,5\n"), INFO).signals["u"]
    assert (flat.times, flat.values, flat.interpolation) == ((0.0, 2.0), (1.0, 5.0), "constant")
    sloped = read_inputs(written(tmp_path, "t,u\n0,0\n2,2\n2,9\n4,11\n"), INFO).signals["u"]
    assert sloped.sample(np.array([1.0, 1.99, 2.0, 3.0])) == pytest.approx([1, 1.99, 9, 10])


@pytest.mark.parametrize("time", [3e-12, 5e-9, 0.01, 2.0, 3.2e7, 1e12])
def test_a_step_between_slopes_is_one_at_any_time(time: float, tmp_path: Path) -> None:
    text = f"t,u\n0,0\n{time!r},2\n{time!r},9\n{2 * time!r},11\n{4 * time!r},2\n"
    signal = read_inputs(written(tmp_path, text), INFO).signals["u"]
    assert signal.sample(time * np.array([0.5, 0.99, 1.0, 1.5])) == pytest.approx([1, 1.98, 9, 10], rel=1e-5)
    assert signal.shortest_dwell == pytest.approx(time), "the step is no dwell"


def test_integers_hold_their_values_between_rows(tmp_path: Path) -> None:
    text = "t,gear,mode\n0,1,Off\n2,2, Hill hold\n4,2,3\n"
    gear, mode = read_inputs(written(tmp_path, text), INFO).signals.values()
    assert gear.sample(np.array([1.9, 2.0, 4.0])).tolist() == [1, 2, 2]
    assert mode.sample(np.array([1.9, 2.0, 4.0])).tolist() == [1, 3, 3]


def test_arrays_marked_names_and_outputs_are_understood(tmp_path: Path) -> None:
    found = read_inputs(written(tmp_path, '\ufefftime,"\'=v",w,speed\n0,1,2 3,70\n\n'), INFO)
    assert {n: s.values for n, s in found.signals.items()} == {"=v": (1,), "w[1]": (2,), "w[2]": (3,)}
    assert found.unused == ("speed",)


@pytest.mark.parametrize(
    "text",
    [
        "t;u;w\r\n0;1,5;1 2\r\n1;-2,5E-1;1,5 2\r\n",
        '\ufeff"t"\tu\tw\n0\t1.5\t1 2\n1\t-0.25\t1.5 2\n',
        "t;w;u\n0;1 2;1.5\n1;1.5 2;-.25\n",
    ],
)
def test_spreadsheets_separate_columns_and_write_decimals_as_their_country_does(
    text: str, tmp_path: Path
) -> None:
    signals = read_inputs(written(tmp_path, text), INFO).signals
    assert {n: s.values for n, s in signals.items()} == {"u": (1.5, -0.25), "w[1]": (1, 1.5), "w[2]": (2,)}


@pytest.mark.parametrize(
    "name", ["", "Time [s]", "Zeit/sec", "time_s", "Time (since start)", "x", "t_1", "Timestamp"]
)
def test_the_time_may_have_any_name_that_states_no_other_unit(name: str, tmp_path: Path) -> None:
    variables = (*INFO.variables, Variable("x", causality="independent"))
    found = read_inputs(written(tmp_path, f"{name},u\n0,1\n2,1\n"), ModelInfo("plant", variables=variables))
    assert found.end == 2


def test_empty_columns_at_the_end_are_left_out(tmp_path: Path) -> None:
    text = "t;u;;\n0;1;;\n\n2;3; ;\n"
    assert read_inputs(written(tmp_path, text), INFO).signals["u"].values == (1.0, 3.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t;u\n0;1,5\n1;1.234\n", "row 3: '1.234' has a point, other numbers have decimal commas"),
        ("t;u\n0;1.234,5\n", "row 2, column u: expected a number, got '1.234,5'"),
        ("t,u\n0,1,5\n", "row 2: 3 cells, expected 2"),
        ("", "a row of names"),
        ("t,throtle\n0,1\n", "column 'throtle'"),
        ("t,speed\n0,1\n", "no column is an input"),
        ("t,gear\n0,1\n1,1.5\n", "row 3, column gear: 1.5: expected an integer for 'gear'"),
        ("u,w\n0,1\n", "the first column must be the time in s, got the input 'u'"),
        ("speed,u\n0,1\n", "the first column must be the time in s, got the output 'speed'"),
        ("t [ms],u\n0,1\n", r"the time must be in s, got 't \[ms\]': multiply it by 0.001"),
        ("Zeit (Minutes),u\n0,1\n", "multiply it by 60"),
        ("time_h,u\n0,1\n", "multiply it by 3600"),
        ("Time.ms,u\n0,1\n", "multiply it by 0.001"),
        ("min,u\n0,1\n", "multiply it by 60"),
        ("t/µs,u\n0,1\n", "multiply it by 0.000001"),
        ("t,u\n0,1\n1\n", "row 3: 1 cells, expected 2 as in row 1"),
        ("t,u\n0,1\n1,high\n", "row 3, column u: expected a number, got 'high'"),
        ("t,u\n0,nan\n", "row 2, column u"),
        ("t,mode\n0,on\n", "column mode: expected a number or one of Off, Hill hold, got 'on'"),
        ("t,u\n3,1\n", "first time must be 0 s"),
        ("t,u\n0,1\n9999999.5,1\n1,1\n", "row 4: time 1 s is before 9999999.5 s"),
        ("t,u\n0,\n", "row 2, column u: the cell is empty; expected a number"),
        ("t,w\n0,1\n", "1 numbers, expected 2"),
        ("t,u,u\n0,1,2\n", "u is given by two columns"),
        ("t;u;;\n0;1;;3\n", "column 3 has no name: write one into row 1, or drop the column"),
        ("t,w,w[1]\n0,1 2,3\n", r"w\[1\] is given by two columns"),
    ],
)
def test_what_is_wrong_is_named(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=said) as raised:
        read_inputs(written(tmp_path, text), INFO)
    assert "u.csv" in str(raised.value)
