"""Samples whose signals are the same although what is chosen differed."""

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.trajectory import Trajectory
from falsifier.llm.prompts import View
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.effects import Effects
from falsifier.testing import START, lag_problem

TIMES = np.linspace(0.0, 10.0, 1001)


def told(*samples: tuple[float, float, float], times: Array = TIMES) -> str:
    """What is told of samples, each from when its input is 1 and its output 1, in s, and a parameter."""
    seen = Effects(View.of(lag_problem(parameters=[START])))
    for number, (acts, reacts, start) in enumerate(samples, start=1):
        columns = {"u": np.where(acts < times, 1.0, 0.0), "x": times / 9 + (reacts < times)}
        seen.add(number, Candidate({}, {"x0": start}), Trajectory(times, columns))
    return seen.text.partition("were the same in ")[2]


def test_a_delay_and_what_never_matters_are_told_with_the_samples_that_show_it() -> None:
    assert told((2.0, 4.0, 0.0), (3.0, 5.0, 0.0)) == (
        "samples 1, 2 until 3.99 s, though u differed from about 2.09 s on."
    )
    (alike, later) = told(*[(2.0 + k, 11.0, k / 4) for k in range(3)], (2.0, 9.0, 0.5)).split("; ")
    assert alike == "samples 1, 2, 3 until 10 s, though u, x0 differed from about 0 s on"
    assert later == "samples 1, 4 until 9 s, though x0 differed from about 0 s on."


def test_nothing_is_told_where_signals_differ_as_soon_as_inputs_do() -> None:
    assert told((2.0, 2.1, 0.0), (3.0, 3.1, 0.0)) == ""
    assert told((2.0, 4.0, 0.0), (2.0, 4.0, 0.0)) == "", "nothing differed"
    assert told((2.0, 3.0, 0.0), (9.0, 9.0, 0.0), times=TIMES[::100]) == "", "one step later is at once"
