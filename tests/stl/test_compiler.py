"""What is computed, and no more: on which samples, and each part once."""

import numpy as np
import pytest

from falsifier.errors import FormulaError
from falsifier.stl import parse
from falsifier.stl.compiler import compile_formula, window_samples
from falsifier.stl.formula import Window
from falsifier.stl.program import Program
from falsifier.stl.steps import run


def compiled(text: str, *, samples: int = 101, **wanted: int) -> Program:
    return compile_formula(parse(text), step=0.1, samples=samples, **wanted)


def computed(program: Program) -> int:
    """Number of values beside the signals."""
    return program.size - len(program.signals) * program.samples


def test_nothing_outside_the_windows_is_computed() -> None:
    program = compiled("G[2,5] F[1,2] (x * y <= 1)")
    assert computed(program) == 2 * 41 + 31 + 1, "products and margins from 3 to 7 s, then the windows"
    assert program.root.place.first == program.root.place.last == 0


def test_a_part_that_stands_twice_is_computed_once_where_either_needs_it() -> None:
    program = compiled("G[0,2] (x*y <= 1) and G[4,5] (x*y <= 1)")
    assert computed(program) == 2 * 51 + 3
    assert (
        compiled("G[0,2] (x <= 1) and G[0,2] (x <= 1)").size
        < compiled("G[0,2] (x <= 1) and G[0,2] (x <= 2)").size
    )


def test_values_at_several_samples_reach_further() -> None:
    program = compiled("G[0,2] (x <= 1)", first=10, last=30)
    assert (program.root.place.first, program.root.place.last) == (10, 30)
    assert computed(program) == 41 + 21


def test_constants_are_worked_out_beforehand() -> None:
    program = compiled("x <= 2*3 + sqrt(16)")
    assert computed(program) == 1
    assert len(program.steps) == 2, "the margin, and its check"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("G[0,11] (x <= 1)", ["[0,11]", "11 s", "10 s"]),
        ("G[0,8] F[0,3] (x <= 1)", ["[0,3]", "11 s"]),
        ("G (x <= 1 and F[0,1] (x > 0))", ["11 s", "without a window"]),
        ("G[0,10] X (x <= 1)", ["10.1 s"]),
        ("(x > 0) U[5,10.1] (x > 1)", ["[5,10.1]"]),
        ("x <= 1/0", ["1/0"]),
        ("x <= log(0 - 1)", ["log("]),
    ],
)
def test_what_does_not_fit_the_grid_is_named(text: str, named: list[str]) -> None:
    with pytest.raises(FormulaError) as caught:
        compiled(text)
    assert all(part in str(caught.value) for part in named), str(caught.value)


def test_windows_are_counted_in_samples() -> None:
    assert window_samples(Window(0.3, 7.2), 0.1) == (3, 72)
    assert window_samples(Window(0.0, 1 / 3), 1 / 30) == (0, 10)
    with pytest.raises(FormulaError, match=r"0\.25 s.*0\.1 s.*0\.2 s"):
        window_samples(Window(0.0, 0.25), 0.1)


def test_signals_lie_first_in_the_order_of_the_formula() -> None:
    program = compiled("G[0,1] (b <= a)", samples=11)
    assert program.signals == ("b", "a")
    buffer = np.concatenate([np.full(11, 2.0), np.full(11, 5.0), np.zeros(program.size - 22)])
    assert run(program.steps, buffer) == -1
    assert program.root.at(buffer, 0) == 3.0, "a - b"
