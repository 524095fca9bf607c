import numpy as np
import pytest

from falsifier.analyses.range_parts import (
    PARTS,
    allowed_labels,
    cells_of,
    edges_of,
    fastest_rate,
    labels_of,
    pace_of,
)
from falsifier.core.signals import Signal
from falsifier.record.manifest import InputRecord


@pytest.mark.parametrize(
    ("signal", "pace", "rate"),
    [
        (Signal((0.0,), (5.0,)), "constant", None),
        (Signal((0.0, 10.0), (0.0, 100.0), "linear"), "slow", 10.0),
        (Signal((0.0, 5.0, 6.0), (0.0, 0.0, 60.0), "linear"), "medium", 60.0),
        (Signal((0.0, 5.0, 5.1), (0.0, 0.0, 60.0), "linear"), "fast", 600.0),
        (Signal((0.0, 5.0), (0.0, 1.0), "constant"), "steps", None),
        # Sampled and held: as what is sampled. Cubics are steepest between their points.
        (Signal((0.0, 10.0), (0.0, 100.0), "linear", 0.5), "slow", 10.0),
        (Signal((0.0, 5.0, 10.0), (0.0, 100.0, 0.0)), "medium", 40.0),
    ],
)
def test_how_fast_an_input_changed(signal: Signal, pace: str, rate: float | None) -> None:
    found = fastest_rate(signal, 10.0)
    assert found == (None if rate is None else pytest.approx(rate, rel=0.01))
    assert pace_of(signal, found, InputRecord(name="u", low=0.0, high=100.0), 10.0) == pace


def test_parts_of_short_lists_of_numbers_are_the_numbers() -> None:
    u = InputRecord(name="u", low=0, high=2, kind="integer")
    assert edges_of(u) == [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)]
    assert cells_of(u, np.array([0.0, 1.0, 2.0])).tolist() == [0, 1, 2]
    assert len(edges_of(InputRecord(name="u", low=0, high=50, kind="integer"))) == PARTS
    assert edges_of(InputRecord(name="u", low=1, high=1)) == [(1.0, 1.0)]
    assert allowed_labels(u) == {0: "0", 1: "1", 2: "2"}


def test_modes_are_named_by_their_kind() -> None:
    assert labels_of("boolean", ()) == {0: "false", 1: "true"}
    assert labels_of("enumeration", [("N", 0), ("D", 1)]) == {0: "N", 1: "D"}
