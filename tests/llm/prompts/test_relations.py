"""Relations between signals, against columns made of each other."""

from dataclasses import replace

import numpy as np

from falsifier.core.model import ModelInfo, Variable
from falsifier.core.trajectory import Trajectory
from falsifier.llm.prompts import View
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.relations import Relations
from falsifier.testing import lag_problem

TIMES = np.linspace(0.0, 10.0, 101)


def relations(*samples: dict[str, Array], times: Array = TIMES) -> str:
    """What is told of samples with these signals, x and others, and the input u."""
    view, names = View.of(lag_problem("G (x <= 0.9)")), [name for name in samples[0] if name != "u"]
    experiment = replace(view.experiment, outputs=tuple(names))
    info = ModelInfo("m", variables=tuple(map(Variable, names)))
    seen = Relations(replace(view, info=info, experiment=experiment))
    for columns in samples:
        seen.add(Trajectory(times, columns))
    return seen.text


def test_what_signals_are_made_of_is_told_in_the_simplest_way_and_once() -> None:
    u, x, still = np.sign(np.sin(TIMES)), np.cos(TIMES), 0.0 * TIMES
    sample = {"x": x, "error": u - x, "copy": u.copy(), "less": -x, "still": still, "u": u}
    assert relations(sample) == "In all samples so far: less = -x; copy = u; error = u - x."
    other = sample | {"error": u - x + 0.1, "still": 0.5 * x}
    assert relations(sample, other) == "In all samples so far: less = -x; copy = u."
    assert relations({"x": x, "other": np.sin(3 * TIMES), "still": still, "u": u}) == ""
    assert relations({"x": x, "still": still, "quiet": still, "u": u}) == "", "of nothing that moved"


def test_a_relation_that_fails_at_one_time_or_whose_signals_are_missing_is_not_told() -> None:
    times = np.linspace(0.0, 10.0, 4001)
    u = np.sin(times)
    assert relations({"x": u, "u": u}, times=times) == "In all samples so far: x = u."
    assert relations({"x": u + (np.arange(4001) == 2001), "u": u}, times=times) == ""
    assert relations({"x": u, "u": u}, {"x": u}, times=times) == ""
