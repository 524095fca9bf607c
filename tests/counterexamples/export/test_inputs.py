import json
from pathlib import Path

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import Freedom
from falsifier.counterexamples.export.inputs import input_table, start_values
from falsifier.counterexamples.export.tables import write_json
from falsifier.problem.loading import load_problem
from falsifier.testing import lag_problem


def test_steps_stand_where_the_simulation_set_them() -> None:
    problem = load_problem("AT1")
    candidate = problem.space.admit(
        Candidate(
            {"throttle": Signal((0.0, 1.23), (100.0, 35.0), "constant"), "brake": Signal((0.0,), (0.0,))}
        )
    )
    table = input_table(problem, candidate)
    # Sampled every 0.05 s and held: the value of 1.23 s arrives at 1.25 s.
    assert table.times.tolist() == pytest.approx([0.0, 1.25, 1.25, 50.0])
    assert table.columns["throttle"].tolist() == [100.0, 100.0, 35.0, 35.0]
    assert table.columns["brake"].tolist() == [0.0] * 4


def test_interpolated_signals_have_a_row_at_every_communication_point() -> None:
    problem = lag_problem(free=Freedom(10, 0.1))
    candidate = Candidate({"u": Signal((0.0, 10.0), (-1.0, 1.0), "linear")})
    table = input_table(problem, candidate)
    assert len(table.times) == problem.experiment.samples
    np.testing.assert_allclose(table.columns["u"], np.linspace(-1, 1, 101), atol=1e-12)


def test_start_values_are_the_fixed_and_the_searched_parameters(tmp_path: Path) -> None:
    from dataclasses import replace

    problem = replace(lag_problem(), parameters={"gain": 0.1 + 0.2, "u": 0.5})
    start = start_values(problem, Candidate({}, {"x0": -1.5}))
    assert start == {"gain": 0.1 + 0.2, "x0": -1.5}
    assert json.loads(write_json(start, tmp_path / "s.json").read_text()) == start
