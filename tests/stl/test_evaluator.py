import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.errors import MonitorError
from falsifier.stl import parse
from falsifier.stl.compiler import compile_formula
from falsifier.stl.evaluator import fill, fill_many
from falsifier.stl.program import Program

TIMES = np.linspace(0.0, 1.0, 11)


def program(text: str = "G[0,1] (x - y <= 3)") -> Program:
    return compile_formula(parse(text), step=0.1, samples=11)


def robustness(compiled: Program, **columns: np.ndarray) -> float:
    buffer = fill(compiled, Trajectory(TIMES, columns), np.empty(compiled.size))
    return compiled.root.at(buffer, 0)


def test_a_buffer_is_written_over_by_the_next_trajectory() -> None:
    compiled = program()
    buffer = np.empty(compiled.size)
    for level in (1.0, 2.0):
        filled = fill(compiled, Trajectory(TIMES, {"x": np.full(11, level), "y": 0 * TIMES}), buffer)
        assert filled is buffer
        assert compiled.root.at(buffer, 0) == 3.0 - level


@pytest.mark.parametrize(
    ("times", "x", "named"),
    [
        (TIMES[:5], np.zeros(5), ["5", "11"]),
        (TIMES**2, np.zeros(11), ["recorded time 1", "0.01 s", "0.1 s"]),
        (TIMES, np.where(TIMES > 0.55, np.nan, 0.0), ["'x'", "nan", "0.6 s"]),
    ],
)
def test_a_trajectory_that_cannot_be_judged_is_said_with_its_place(
    times: np.ndarray, x: np.ndarray, named: list[str]
) -> None:
    compiled = program("G[0,1] (x <= 3)")
    with pytest.raises(MonitorError) as caught:
        fill(compiled, Trajectory(times, {"x": x}), np.empty(compiled.size))
    assert all(part in str(caught.value) for part in named), str(caught.value)


def test_a_predicate_outside_its_domain_is_said_with_the_values_there() -> None:
    with pytest.raises(MonitorError, match=r"0\.4 s.*sqrt\(x\) = nan"):
        robustness(program("G[0,1] (sqrt(x) <= y)"), x=np.where(TIMES > 0.35, -1.0, 1.0), y=TIMES)


def test_a_missing_signal_is_named() -> None:
    with pytest.raises(MonitorError, match="'y'"):
        robustness(program(), x=TIMES)


class TestMany:
    def test_each_is_judged_like_alone(self) -> None:
        x, y = np.random.default_rng(0).random((2, 5, 11))
        compiled = program("G[0,0.5] F[0,0.5] (x >= y)")
        alone = [robustness(compiled, x=a, y=b) for a, b in zip(x, y, strict=True)]
        assert fill_many(compiled, {"x": x, "y": y}).tolist() == alone

    def test_a_formula_without_signals_needs_their_number_only(self) -> None:
        assert fill_many(program("G[0,1] (1 <= 3)"), {"z": np.zeros((4, 11))}).tolist() == [2.0] * 4

    @pytest.mark.parametrize(
        ("columns", "named"),
        [
            ({"x": np.zeros((2, 11))}, "'y'"),
            ({"x": np.zeros((2, 11)), "y": np.zeros((2, 10))}, "11"),
            ({"x": np.zeros((2, 11)), "y": np.zeros((3, 11))}, "11"),
            ({"x": np.zeros((2, 11)), "y": np.full((2, 11), np.inf)}, "trajectory 0: .*'y'"),
        ],
    )
    def test_what_does_not_fit_is_named(self, columns: dict[str, np.ndarray], named: str) -> None:
        with pytest.raises(MonitorError, match=named):
            fill_many(program(), columns)
