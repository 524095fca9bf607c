"""Small records whose coverage is known."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from falsifier import Candidate, Signal, Trajectory, coverage, falsify
from falsifier.analyses.coverage import Coverage, coverage_of, pace_of
from falsifier.core.ranges import ParameterRange, Range
from falsifier.core.signals import Interpolation
from falsifier.errors import SpecError
from falsifier.record.manifest import Manifest, ModeRecord, describe
from falsifier.search.request import RunRequest
from falsifier.testing import lag_problem
from falsifier.views.analyses_text import coverage_json, coverage_text
from tests.problems import decades, mostly_broken

TIMES = np.linspace(0.0, 10.0, 11)


def described(*inputs: Range, parameters: tuple[Range, ...] = ()) -> Manifest:
    made = describe(RunRequest(problems=()), [lag_problem()], "uniform")
    modes = (ModeRecord(name="gear", kind="enumeration", items=(("N", 0), ("D", 1), ("R", 2))),)
    return made.model_copy(update={"inputs": inputs, "parameters": parameters, "modes": modes})


def tried(*signals: Signal, trajectory: Trajectory | None = None) -> Coverage:
    u = Range(name="u", low=0.0, high=100.0)
    return coverage_of(described(u), [(Candidate({"u": s}), trajectory) for s in signals])


def test_parts_of_a_range_that_no_value_was_in_are_gaps_and_at_first_all_of_them() -> None:
    (u,) = tried(Signal((0.0,), (5.0,)), Signal((0.0, 10.0), (20.0, 49.0), "linear")).ranges
    assert (u.low, u.high) == (5.0, 49.0)
    assert u.parts.tolist() == [1, 0, 1, 1, 1, 0, 0, 0, 0, 0]
    assert u.gaps == ((10.0, 20.0), (50.0, 100.0))
    p = Range(name="p", low=0.0, high=1.0)
    found = coverage_of(described(Range(name="u", low=0.0, high=1.0), parameters=(p,)), [])
    assert [(r.low, r.tried, r.gaps) for r in found.ranges] == [(None, 0, ((0.0, 1.0),))] * 2


def test_parts_of_a_range_in_decades_are_decades(tmp_path: Path) -> None:
    bias = ParameterRange("p", 1e-8, 100.0, scale="log")
    found = coverage_of(described(parameters=(bias,)), [(Candidate({}, {"p": 3e-5}), None)])
    (p,) = found.ranges
    assert p.parts.tolist() == [0, 0, 0, 1, 0, 0, 0, 0, 0, 0]
    np.testing.assert_allclose(p.gaps, ((1e-8, 1e-5), (1e-4, 100.0)))
    assert "1e-08 to 100 in decades" in coverage_text(found, "R")
    falsify(decades(), "uniform", budget=3, directory=tmp_path)
    assert coverage_json(coverage(tmp_path))["searched"][0]["scale"] == "log"


@pytest.mark.parametrize(("hold", "at"), ((None, 4.01), (0.02, 4.01), (0.02, 4.02)))
def test_a_pulse_between_two_samples_is_seen(hold: float | None, at: float) -> None:
    (u,) = tried(Signal((0.0, at, at + 0.02), (5.0, 95.0, 5.0), "constant", hold)).ranges
    assert (u.high, u.parts[9]) == (95.0, 1)


@pytest.mark.parametrize("interpolation", ["linear", "pchip"])
def test_parts_that_an_input_passes_fast_are_tried(interpolation: Interpolation) -> None:
    (u,) = tried(Signal((0.0, 4.99, 5.01), (0.0, 0.0, 100.0), interpolation)).ranges
    assert u.parts.tolist() == [1] * 10


def test_values_are_counted_where_they_were_in_time() -> None:
    (u,) = tried(Signal((0.0, 5.0), (5.0, 95.0), "constant")).ranges
    assert u.times is not None
    assert (u.times[:19, 0] == 1).all() and (u.times[21:, 0] == 0).all()
    assert (u.times[:19, 9] == 0).all() and (u.times[21:, 9] == 1).all()


def test_combinations_are_of_values_at_the_same_time() -> None:
    ranges = [Range(name=name, low=0.0, high=10.0) for name in "uv"]
    steps = Signal((0.0, 5.0), (0.5, 9.5), "constant")
    p = Range(name="p", low=0.0, high=1.0)
    found = coverage_of(
        described(*ranges, parameters=(p,)), [(Candidate({"u": steps, "v": steps}, {"p": 0.55}), None)]
    )
    pairs = {(pair.first, pair.second): pair.tried for pair in found.pairs}
    assert np.argwhere(pairs["u", "v"]).tolist() == [[0, 0], [9, 9]]
    assert np.argwhere(pairs["u", "p"]).tolist() == [[0, 5], [9, 5]]
    assert found.pairs[0].count == 2
    # Also of values that are held between two samples only.
    pulse = Signal((0.0, 4.012, 4.022), (0.5, 9.5, 0.5), "constant")
    late = Signal((0.0, 4.018, 4.026), (0.5, 9.5, 0.5), "constant")
    for hold, others in ((None, [[0, 9], [9, 0], [9, 9]]), (0.01, [[9, 9]])):
        candidate = Candidate({"u": pulse.held(hold), "v": late.held(hold)})
        (pair,) = coverage_of(described(*ranges), [(candidate, None)]).pairs
        assert np.argwhere(pair.tried).tolist() == [[0, 0], *others]


def test_many_simulations_of_many_inputs_take_little_memory() -> None:
    names = [f"u{k}" for k in range(12)]
    ranges = [Range(name=name, low=0.0, high=1.0) for name in names]
    candidate = Candidate(dict.fromkeys(names, Signal((0.0,), (0.5,))))
    tracemalloc.start()
    coverage_of(described(*ranges), [(candidate, None)] * 500)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8e6


def test_whole_numbers_are_parts_of_their_own_and_modes() -> None:
    u = Range(name="u", low=0, high=2, kind="integer")
    # 1 is between two samples, and after the last one.
    steps = Signal((0.0, 4.9, 5.0, 9.7), (0.0, 1.0, 2.0, 1.0), "constant", hold=0.6)
    found = coverage_of(described(u), [(Candidate({"u": steps}), None)])
    assert found.ranges[0].parts.tolist() == [1, 0, 1]
    assert found.ranges[0].gaps == ((1.0, 1.0),)
    mode = found.modes[0]
    assert (mode.name, mode.seen, mode.never, mode.changes) == ("u", ("0", "2"), ("1",), (("0", "2"),))


def test_outputs_and_modes_are_read_from_trajectories() -> None:
    first = Trajectory(TIMES, {"x": TIMES, "gear": np.where(TIMES > 4, 1.0, 0.0), "u": TIMES}, {"x": "m"})
    second = Trajectory(TIMES, {"x": -TIMES, "gear": np.zeros(11), "u": TIMES}, {"x": "m"})
    u = Range(name="u", low=0.0, high=100.0)
    candidate = Candidate({"u": Signal((0.0,), (1.0,))})
    found = coverage_of(described(u), [(candidate, first), (candidate, second), (candidate, None)])
    assert (found.simulations, found.trajectories) == (3, 2)
    (x,) = found.outputs
    assert (x.name, x.unit, x.lows.min(), x.highs.max()) == ("x", "m", -10.0, 10.0)
    assert x.highs[3] == 3.0 and x.lows[3] == -3.0
    (gear,) = found.modes
    assert (gear.seen, gear.never, gear.changes) == (("N", "D"), ("R",), (("N", "D"),))


def test_a_run_is_read_from_its_directory_alone_and_what_is_no_path_refused(tmp_path: Path) -> None:
    result = falsify(lag_problem("G[0,10] (x <= 2)", inputs=2), "uniform", budget=6, directory=tmp_path)
    found = coverage(tmp_path)
    values = [v for e in result.evaluations for v in e.candidate.signals["u"].values]
    assert (found.simulations, found.trajectories, found.failures) == (6, 6, ())
    assert found.ranges[0].low == pytest.approx(min(values))
    assert found.ranges[0].high == pytest.approx(max(values))
    assert [o.name for o in found.outputs] == ["x"]
    with pytest.raises(SpecError, match="coverage: expected a run directory, got None"):
        coverage(None)  # type: ignore[arg-type]


def test_causes_of_failed_simulations_are_counted(tmp_path: Path) -> None:
    problem = lag_problem("G[0,10] (x <= 3)", response=mostly_broken)
    result = falsify(problem, "uniform", budget=20, seed=1, directory=tmp_path)
    found = coverage(tmp_path)
    assert found.failures == result.failures and found.failures[0].count > 1
    assert found.failures[0].text in coverage_text(found, "R")
    assert coverage_json(found)["failures"][0]["simulation"] == found.failures[0].simulation


@pytest.mark.parametrize(
    ("signal", "pace"),
    [
        (Signal((0.0,), (5.0,)), "constant"),
        (Signal((0.0, 10.0), (0.0, 100.0), "linear"), "slow"),
        (Signal((0.0, 5.0, 6.0), (0.0, 0.0, 60.0), "linear"), "medium"),
        (Signal((0.0, 5.0, 5.1), (0.0, 0.0, 60.0), "linear"), "fast"),
        (Signal((0.0, 5.0), (0.0, 1.0), "constant"), "steps"),
        # Sampled and held: as what is sampled. Cubics are steepest between their points.
        (Signal((0.0, 10.0), (0.0, 100.0), "linear", 0.5), "slow"),
        (Signal((0.0, 5.0, 10.0), (0.0, 100.0, 0.0)), "medium"),
    ],
)
def test_how_fast_an_input_changed(signal: Signal, pace: str) -> None:
    assert pace_of(signal, Range(name="u", low=0.0, high=100.0), 10.0) == pace
