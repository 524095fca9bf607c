"""What is computed, and no more: on which samples, and each part once."""

from falsifier.stl import parse
from falsifier.stl.compiler import compile_formula
from falsifier.stl.program import Program


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
