"""Each literal is read back by its own language as the same text."""

import ast
import re

import numpy as np
import pytest
from hypothesis import given, strategies as st

from falsifier.core import literals
from falsifier.core.candidate import Candidate
from falsifier.core.literals import printable
from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace
from falsifier.core.words import candidate_facts, in_one_line, signal_text
from tests.hostile.names import names


@given(names)
def test_literals_are_read_back_as_the_same_text(name: str) -> None:
    assert ast.literal_eval(literals.python_docstring(name)) == name
    assert re.fullmatch(r'"(?:[^"\\]|\\.)*"', literals.modelica_string(name), re.DOTALL)
    assert re.fullmatch(r"[\w.]+|'(?:[^'\\]|\\.)*'", literals.modelica_path(name), re.DOTALL)


@given(names)
def test_cells_and_lines_are_text(name: str) -> None:
    assert not re.match(r"[=@\t\n]|[+-](?![\d.])", literals.csv_cell(name))
    line = literals.one_line(f"{name}\xad\u061c\u200b\u2060\ufeff\U000e0041")
    assert len(line.splitlines()) <= 1 and not ACTING.search(line)
    assert "\n" not in literals.markdown_text(name) and "\n" not in literals.markdown_code(name)
    assert not re.search(r"(?<!\\)(?:\\\\)*[<|`\[]", literals.markdown_text(name))


ACTING = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u202a-\u202e\u2060-\u206f\ufeff\U000e0041\ud800-\udfff]"
)


@pytest.mark.parametrize(
    ("sent", "shown"),
    [
        ("plain\ttext\nin lines, äöü, ≤ and 😀", "plain\ttext\nin lines, äöü, ≤ and 😀"),
        ("\x1b[1;31mred\x9b0m", "red"),
        ("\x1b]0;a title\x07shown", "shown"),
        ("\x1b]8;;http://elsewhere\x1b\\a link\x1b]8;;\x1b\\", "a link"),
        ("overwritten\rwritten over\b\b", "overwrittenwritten over"),
        ("reversed \u202etxet\u202c", "reversed txet"),
        ("half \ud83d a pair", "half ? a pair"),
        ("cut off \x1b[", "cut off ["),
    ],
)
def test_what_a_terminal_would_act_on_is_removed(sent: str, shown: str) -> None:
    assert printable(sent) == shown


@given(st.text(st.one_of(st.sampled_from("\x1b\x9b\x9d\x07[]0;m\\\n"), st.characters(codec=None))))
def test_nothing_that_acts_is_left_of_any_text(sent: str) -> None:
    shown = printable(sent)
    assert not ACTING.search(shown)
    assert printable(shown) == shown
    shown.encode("utf-8")


SPACE = SearchSpace((InputRange("u", 0, 1, unit="V"),), (ParameterRange("mass", 0, 9, unit="kg"),), 10.0)
CANDIDATE = Candidate({"u": Signal((0.0, 2.0), (0.25, 1.0), "linear")}, {"mass": 1 / 3})


def test_inputs_come_first_with_the_units_of_the_space() -> None:
    told = "linear: 0.25 at 0 s, 1 at 2 s (1 switch)"
    assert candidate_facts(CANDIDATE, SPACE) == [
        ("input", f"u [V] {told}"),
        ("parameter", "mass [kg] = 0.3333333333"),
    ]
    modes = SearchSpace((), (ParameterRange("mode", 1, 7, kind="enumeration", items=(("Eco", 7),)),), 10.0)
    assert candidate_facts(Candidate(parameters={"mode": 7.0}), modes) == [("parameter", "mode = 7 (Eco)")]
    assert in_one_line(CANDIDATE) == f"u {told}; mass = 0.3333333333", "without a space no unit is known"
    assert in_one_line(Candidate()) == ""


def test_what_is_close_to_each_other_has_the_digits_that_it_needs() -> None:
    narrow = SearchSpace(
        (InputRange("u", 1e12, 1e12 + 1.0),), (ParameterRange("mass", 999999.999, 1000000.001),), 10.0
    )
    chosen = Candidate({"u": Signal((0.0,), (1e12 + 1 / 3,))}, {"mass": 1000000.0005})
    assert in_one_line(chosen, narrow) == "u constant 1000000000000.3334; mass = 1000000.0005"
    assert in_one_line(chosen).endswith("; mass = 1000000.0005"), "what somebody wrote has all its digits"
    assert in_one_line(Candidate(parameters={"mass": np.float64(0.25)})) == "mass = 0.25"
    pulse = Signal((0.0, 0.0012345, 0.0012346), (1e6, 1e6 + 1e-3, 1e6), "constant")
    assert "1000000.001 at 0.0012345 s, 1000000 at 0.0012346 s" in signal_text(pulse)


def test_a_long_signal_is_cut_in_the_middle_and_says_how_lively_it_is() -> None:
    times = tuple(0.5 * i for i in range(40))
    text = signal_text(Signal(times, tuple(float(i % 2) for i in range(40)), "constant"))
    assert text.startswith("held: 0 at 0 s, 1 at 0.5 s")
    assert "... 28 more ..." in text
    assert text.endswith("1 at 19.5 s (39 switches, shortest dwell 0.5 s)")


def test_steps_that_are_held_are_told_when_they_take_effect() -> None:
    held = Signal((0.0, 0.9, 1.2, 1.4), (1.0, 2.0, 3.0, 4.0), "constant", hold=0.5)
    told = "u held: 1 at 0 s, 2 at 1 s, 4 at 1.5 s (2 switches, shortest dwell 0.5 s)"
    assert in_one_line(Candidate({"u": held})) == told
    late = Candidate({"u": Signal((0.0, 2.5, 9.5), (1.0, 2.0, 3.0), "constant", hold=3.0)})
    assert candidate_facts(late, SPACE) == [("input", "u [V] held: 1 at 0 s, 2 at 3 s (1 switch)")]
