from dataclasses import replace

import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Freedom, ParameterRange, Scale
from falsifier.core.signals import Signal
from falsifier.counterexamples.simplicity import rest_value, simplicity
from falsifier.problem.loading import load_problem
from falsifier.testing import lag_problem

FREE = Freedom(max_control_points=20, min_interval=0.1)


def test_the_order_of_simplicity() -> None:
    problem = lag_problem(free=FREE)

    def key(times: tuple[float, ...], values: tuple[float, ...], interpolation: str = "linear") -> object:
        return simplicity(problem, Candidate({"u": Signal(times, values, interpolation)}))  # type: ignore[arg-type]

    in_order = [
        key((0.0,), (0.0,), "constant"),  # at rest
        key((0.0,), (0.0,)),  # the same as a line
        key((0.0, 5.0), (0.0, 0.0)),  # with a point more
        key((0.0,), (1.0,)),  # at a bound
        key((0.0,), (0.5,)),  # a round number
        key((0.0,), (0.51,)),  # a longer one
        key((0.0, 5.0), (0.0, 1.0)),  # a change
        key((0.0, 5.1), (0.0, 1.0)),  # at a longer time
        key((0.0, 5.0, 6.0), (0.0, 1.0, 0.0)),  # two changes between the same values
        key((0.0, 5.0, 6.0), (0.0, 1.0, 0.5)),  # a third value
    ]
    assert in_order == sorted(in_order)  # type: ignore[type-var]
    assert len(set(map(repr, in_order))) == len(in_order)


def test_candidates_that_differ_have_different_keys() -> None:
    held, line = (Signal((0.0, 5.0), (0.0, 1.0), how) for how in ("constant", "linear"))
    one, other = (Candidate({"throttle": a, "brake": b}) for a, b in ((held, line), (line, held)))
    problem = load_problem("AT1")
    assert simplicity(problem, one) != simplicity(problem, other)


@pytest.mark.parametrize(("scale", "nearer"), [("linear", 1e-4), ("log", 5e-3)])
def test_what_is_closer_to_nominal_is_measured_on_the_scale(scale: Scale, nearer: float) -> None:
    problem = lag_problem(parameters=(ParameterRange("x0", 1e-6, 1.0, nominal=1e-3, scale=scale),))
    signal = Signal((0.0,), (0.0,), "constant")
    found = sorted((1e-4, 5e-3), key=lambda x: simplicity(problem, Candidate({"u": signal}, {"x0": x})))
    assert found[0] == nearer


def test_rest_is_the_start_value_within_the_range() -> None:
    problem = lag_problem(parameters=(ParameterRange("x0", 0.5, 1.0, nominal=0.0),))
    (u,), (x0,) = problem.space.inputs, problem.space.parameters
    assert rest_value(problem, u) == 0.0
    assert rest_value(problem, x0) is None
    assert rest_value(problem, replace(u, low=0.2)) is None
