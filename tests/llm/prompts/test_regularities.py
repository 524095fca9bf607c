"""What signals were each time that a discrete one changed, against columns made for it."""

from dataclasses import replace

import numpy as np

from falsifier.core.model import ModelInfo, Variable
from falsifier.core.trajectory import Trajectory
from falsifier.llm.prompts import View
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.regularities import Regularities
from falsifier.testing import lag_problem

TIMES = np.linspace(0.0, 100.0, 1001)
# It rises from 1 to 2 in 11.5 s, again and again; the input is switched every 9.4 s.
SAW, SWITCHED = 1.0 + np.mod(TIMES, 11.5) / 11.5, np.sign(np.sin(TIMES / 3.0))


def lines(count: int, counter: Array, mode: Array, saw: Array = SAW) -> list[str]:
    """What is told of so many samples with these discrete signals beside the ones above."""
    view = View.of(lag_problem("G (x <= 0.9)"))
    kinds = (Variable("x"), Variable("n", kind="integer"), Variable("mode", kind="boolean"))
    experiment = replace(view.experiment, stop_time=100.0, output_interval=0.1, outputs=("x", "n", "mode"))
    space = replace(view.space, stop_time=100.0)
    seen = Regularities(
        replace(view, info=ModelInfo("m", variables=kinds), space=space, experiment=experiment)
    )
    for _ in range(count):
        seen.add(Trajectory(TIMES, {"x": saw, "n": counter, "mode": mode, "u": SWITCHED}))
    return seen.text.splitlines()


def test_thresholds_and_conditions_are_told_of_changes_that_were_seen_several_times() -> None:
    parity, follower = np.floor(TIMES / 11.5) % 2, (SWITCHED > 0).astype(np.float64)
    assert lines(1, 0 * TIMES, 0 * TIMES) == []
    head, up, down, on, off = lines(3, parity, follower)
    assert "just before each change" in head
    assert [up, down] == ["- n 0 -> 1, 12 times: x 1.991", "- n 1 -> 0, 12 times: x 1.991"]
    assert on.startswith("- mode 0 -> 1, ") and off.startswith("- mode 1 -> 0, ")
    assert "u 1" in on and "u -1" in off, "an input has its new value"


def test_all_steps_of_a_counter_are_one_change() -> None:
    _, only = lines(2, np.floor(TIMES / 11.5), 0 * TIMES)
    assert only == "- n up, 16 times: x 1.991"


def test_all_changes_are_counted_however_many_a_sample_has() -> None:
    turns = np.floor(TIMES / 1.3)
    for counter, told in ((turns % 2, "- n 0 -> 1, 76 times: "), (turns, "- n up, 152 times: ")):
        line = lines(2, counter, 0 * TIMES, saw=np.mod(TIMES, 1.3))[1]
        assert line.startswith(f"{told}x 1.2")
