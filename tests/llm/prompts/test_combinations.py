"""Values of discrete signals that were never there together, of columns made for it."""

from dataclasses import replace

import numpy as np

from falsifier.core.model import ModelInfo, Variable
from falsifier.core.ranges import InputRange
from falsifier.core.trajectory import Trajectory
from falsifier.llm.prompts import View
from falsifier.llm.prompts.combinations import Combinations
from falsifier.testing import lag_problem

TIMES = np.linspace(0.0, 10.0, 101)
ON, LATE, KEY = ((start <= TIMES).astype(np.float64) for start in (2.0, 6.0, 9.0))


def test_the_likeliest_combinations_that_never_came_about_are_told_first() -> None:
    info = ModelInfo("m", variables=(Variable("x", kind="integer"), Variable("mode", kind="boolean")))
    view = View.of(lag_problem("G (x <= 0.9)"))
    keys = tuple(InputRange(name, 0, 1, control_points=2, kind="boolean") for name in ("key", "lock"))
    space = replace(view.space, inputs=keys)
    experiment = replace(view.experiment, outputs=("x", "mode"))
    seen = Combinations(replace(view, info=info, space=space, experiment=experiment))
    seen.add(Trajectory(TIMES, {"x": ON, "mode": LATE, "key": KEY, "lock": 1 - KEY}))
    told = "mode 1 with x 0; mode 0 with key 1; mode 0 with lock 0; x 0 with key 1; x 0 with lock 0"
    found = seen.text.removeprefix("Never at one time so far: ").removesuffix(".").split("; ")
    assert {frozenset(each.split(" with ")) for each in found} == {
        frozenset(each.split(" with ")) for each in told.split("; ")
    }, "inputs are the language model's own business"
    assert found[-1] in ("mode 1 with x 0", "x 0 with mode 1"), "no input is in it"
    seen.add(Trajectory(TIMES, {"x": 1 - ON, "mode": LATE, "key": KEY, "lock": 1 - KEY}))
    assert "x" not in seen.text
    many = Combinations(replace(view, info=info, experiment=experiment))
    many.add(Trajectory(TIMES, {"x": TIMES // 1, "mode": LATE, "u": 0 * TIMES}))
    assert many.text == "", "a counter has too many values"


def test_values_of_an_input_that_a_mode_has_not_seen_are_told_together() -> None:
    view = View.of(lag_problem("G (x <= 0.9)"))
    keys = (InputRange("key", 0, 9, control_points=2, kind="integer"),)
    info = ModelInfo("m", variables=(Variable("x", kind="boolean"),))
    seen = Combinations(replace(view, info=info, space=replace(view.space, inputs=keys)))
    seen.add(Trajectory(TIMES, {"x": LATE, "key": np.minimum(TIMES // 1, 9.0)}))
    assert seen.text == "Never at one time so far: x 1 with key 0, 1, 2, 3, 4, 5; x 0 with key 6, 7, 8, 9."


def test_a_real_signal_that_looks_discrete_in_some_samples_only_is_not_mistaken() -> None:
    info = ModelInfo("m", variables=(Variable("x", kind="boolean"), Variable("mode")))
    view = View.of(lag_problem("G (x <= 0.9)"))
    view = replace(view, info=info, experiment=replace(view.experiment, outputs=("x", "mode")))
    together = Trajectory(TIMES, {"x": ON, "mode": 0 * TIMES, "u": TIMES})
    moving = Trajectory(TIMES, {"x": ON, "mode": 1 - ON, "u": TIMES})
    seen, real = Combinations(view), Combinations(view)
    for each in (together, moving):
        seen.add(each)
    assert seen.text == "Never at one time so far: x 1 with mode 1."
    for each in (moving, together, Trajectory(TIMES, {"x": ON, "mode": TIMES / 7, "u": TIMES})):
        real.add(each)
    assert real.text == ""
