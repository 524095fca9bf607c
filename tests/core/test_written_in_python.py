"""What users write in Python is refused in words where it is written."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsifier.core.arguments import path_of
from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.errors import SpecError

HUGE = 10**400  # a number that no float can be


@pytest.mark.parametrize(
    ("signals", "parameters", "said"),
    [
        (None, {}, "signals: expected signals by name"),
        ({"u": 3}, {}, "signals, 'u': expected a Signal, got 3"),
        ({}, [1], "parameters: expected parameters by name"),
        ({}, {"p": "a"}, "parameters, 'p': expected a finite number"),
        ({}, {"p": float("nan")}, "parameters, 'p': expected a finite number"),
        ({}, {"p": HUGE}, "parameters, 'p': expected a finite number"),
    ],
)
def test_a_candidate_consists_of_signals_and_numbers(signals: Any, parameters: Any, said: str) -> None:
    with pytest.raises(SpecError, match=said):
        Candidate(signals, parameters)


def test_numbers_that_no_float_can_be_are_refused() -> None:
    with pytest.raises(SpecError, match="numbers"):
        Signal((0, HUGE), (1, 2))


def test_control_points_are_floats_whatever_numbers_are_given() -> None:
    """A model in Python would calculate with whole numbers, and the record cannot hold those of numpy."""
    for times in ((0,), (0, 1)):
        signal = Signal(times, (1,) * len(times), "constant")
        assert signal.sample(np.array([0.0, 1.0])).dtype == np.float64
    values: Any = (np.float32(0.5),)
    parameters: Any = {"count": np.int64(3)}
    written = json.loads(json.dumps(Candidate({"u": Signal((0.0,), values)}, parameters).to_json()))
    assert (written["signals"]["u"]["values"], written["parameters"]) == ([0.5], {"count": 3.0})


def test_an_empty_text_is_no_path() -> None:
    assert path_of("directory", ".") == Path()
    with pytest.raises(SpecError, match="directory: expected a path, got an empty text"):
        path_of("directory", "")
