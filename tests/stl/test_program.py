import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.stl import parse
from falsifier.stl.compiler import compile_formula
from falsifier.stl.evaluator import fill
from falsifier.stl.margins import ON_LIMIT

TIMES = np.arange(11.0)


def test_every_part_finds_its_values_in_the_buffer() -> None:
    program = compile_formula(parse("G[0,2] (x <= 5 and F[1,3] (x >= 3))"), step=1.0, samples=11)
    buffer = fill(program, Trajectory(TIMES, {"x": TIMES}), np.empty(program.size))
    parts = {part.text: part for part in program.root.walk()}
    assert list(parts) == [
        "G[0,2] (x <= 5 and F[1,3] (x >= 3))",
        "x <= 5 and F[1,3] (x >= 3)",
        "x <= 5",
        "F[1,3] (x >= 3)",
        "x >= 3",
    ]
    assert parts["x <= 5"].over(buffer, 0, 2).tolist() == [5.0, 4.0, 3.0]
    assert parts["F[1,3] (x >= 3)"].over(buffer, 0, 2).tolist() == [ON_LIMIT, 1.0, 2.0]
    assert [parts["x <= 5 and F[1,3] (x >= 3)"].at(buffer, k) for k in range(3)] == [ON_LIMIT, 1.0, 2.0]
    assert program.root.at(buffer, 0) == ON_LIMIT


@pytest.mark.parametrize(
    ("text", "window"), [("G[1,3] (x <= 1)", (6, 8)), ("F (x <= 1)", (5, 10)), ("x <= 1", None)]
)
def test_a_window_is_counted_from_where_the_operator_stands(
    text: str, window: tuple[int, int] | None
) -> None:
    program = compile_formula(parse(text), step=1.0, samples=11)
    assert program.root.window_at(5) == window
