import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from falsifier.core.trajectory import Trajectory
from falsifier.engines.coverage.explorer import describe
from falsifier.engines.coverage.marks import MODES, Mark, Marker
from falsifier.testing import lag_problem
from tests.engines.coverage.support import lock_problem


def lock_marks(stage: list[float], opened: list[float]) -> dict[Mark, float]:
    times = np.linspace(0.0, 0.5 * (len(stage) - 1), len(stage))
    columns = {"stage": np.array(stage), "open": np.array(opened)}
    return Marker.of(lock_problem()).marks(Trajectory(times, columns))


def test_values_changes_and_modes_are_marks_with_the_time_of_their_first_occurrence() -> None:
    marks = lock_marks([0, 1, 0, 1, 2], [0, 0, 0, 0, 1])
    assert marks[Mark("stage", ("is", 0.0))] == 0.0
    assert marks[Mark("stage", ("changes", 0.0, 1.0, 1))] == 0.5
    assert marks[Mark("stage", ("changes", 0.0, 1.0, 2))] == 1.5
    assert marks[Mark(MODES, ("stage = 2", "open = 1"))] == 2.0
    assert Mark("open", ("is", 1.0)) in marks
    assert Mark(MODES, ("stage = 0", "open = 1")) not in marks


def test_the_order_of_changes_and_the_time_between_them_are_marks() -> None:
    soon = lock_marks([0, 1, 1, 1, 1, 1], [0, 0, 1, 1, 1, 1])
    late = lock_marks([0, 1, 1, 1, 1, 1], [0, 0, 0, 0, 0, 1])
    other = lock_marks([0, 0, 1, 1, 1, 1], [0, 1, 1, 1, 1, 1])
    pairs = [{m for m in marks if m.what[0] == "after"} for marks in (soon, late, other)]
    assert all(len(found) == 1 for found in pairs)
    assert len(set.union(*pairs)) == 3


def test_a_signal_that_chatters_does_not_hide_the_others() -> None:
    count = 5000
    opened = np.zeros(count)
    opened[3] = 1
    marks = lock_marks((np.arange(count) % 2.0).tolist(), opened.tolist())
    assert len(marks) < 100
    assert Mark("open", ("changes", 0.0, 1.0, 1)) in marks


def test_levels_and_closeness_to_a_threshold_count_in_octaves() -> None:
    problem = lag_problem("G[0,10] (x <= 0.9)")
    marker = Marker.of(problem)
    times = np.linspace(0.0, 10.0, 101)

    def found(scale: float) -> set[Mark]:
        x = scale * (1 - np.exp(-times))
        return set(marker.marks(Trajectory(times, {"x": x, "u": np.ones(101)})))

    assert {m.what[0] for m in found(0.85) - found(0.5)} == {"up", "near"}
    assert not {m.source for m in found(0.5)} & {"u"}
    assert any(m.what[0] == "changes" for m in found(0.95)), "the predicate became false"


@given(
    st.lists(
        st.sampled_from([0.0, 1e-300, -1.0, 2.0, 1e300, np.inf, np.nan, -np.inf]), min_size=2, max_size=9
    )
)
@example([0.0, float(np.nextafter(2.0**-10, 0.0))])  # its logarithm is rounded up to that of 2 ** -10
def test_any_numbers_have_marks(values: list[float]) -> None:
    marker = Marker.of(lag_problem("G[0,10] (x <= 0.9)"))
    times = np.linspace(0.0, 1.0, len(values))
    marker.marks(Trajectory(times, {"x": np.array(values), "u": np.zeros(len(values))}))


def test_marks_are_said_in_words() -> None:
    assert describe(Mark("gear", ("is", 3.0))) == "gear = 3"
    assert describe(Mark("gear", ("changes", 1.0, 2.0, 2))) == "gear change from 1 to 2 2 times"
    assert (
        describe(Mark("x", ("after", 0.0, 1.0, "y", 1.0, 0.0, 3)))
        == "x change from 0 to 1 after y from 1 to 0"
    )
    assert describe(Mark("x > 3", ("near", 2))) == "x > 3 come close to its threshold"
    assert describe(Mark("x", ("up", -2))) == "x go up"
    assert describe(Mark(MODES, ("gear = 1", "brake = 0"))) == "gear = 1 and brake = 0"
