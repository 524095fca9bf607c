"""What is missing for a lower robustness where it has few values."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from bench.example_systems import commands_problem
from falsifier import coverage, falsify
from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.engines.briefing import preview
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.evaluation.levels import Climb
from falsifier.llm.usage import count_tokens
from falsifier.stl import Monitor, parse
from falsifier.testing import lag_problem
from falsifier.views.analyses_text import coverage_json, coverage_text

Columns = Mapping[str, Sequence[float]]
TIMES = np.linspace(0.0, 4.0, 5)


def commanded(*commands: float) -> Evaluation:
    """A simulation of the four commands, each held for 2 s."""
    times = tuple(2.0 * k for k in range(len(commands)))
    return evaluate(
        commands_problem(), Candidate({"command": Signal(times, tuple(map(float, commands)), "constant")})
    )


def climb_of(formula: str, *courses: Columns, labels: dict[int, str] | None = None) -> Climb:
    """A climb of trajectories; ``stage`` may count up."""
    climb, parsed = Climb({"stage": labels or {}}), parse(formula)
    monitor = Monitor(parsed, step=1.0, samples=5)
    for number, columns in enumerate(courses, start=1):
        trajectory = Trajectory(TIMES, {name: np.array(c, float) for name, c in columns.items()})
        climb.add(number, monitor.evaluate(trajectory), trajectory, parsed.predicates)
    return climb


FIRST, SECOND = [0, 0, 1, 1, 1], [0, 1, 2, 0, 0]
COURSES = [{"stage": FIRST}] * 6 + [{"stage": SECOND}, {"stage": FIRST}, {"stage": SECOND}]


def test_a_staircase_names_the_comparison_that_is_missing_and_the_step_that_was_never_made() -> None:
    climb = climb_of("G[0,4] (stage <= 2)", *COURSES)
    assert climb.is_told
    assert [(x.robustness, x.simulations, x.first) for x in climb.levels.found][1:] == [(1.0, 7, 1)]
    decided, counts = climb.lines
    assert decided.startswith("stage <= 2 decided the lowest robustness, with stage = 2")
    assert decided.endswith("takes stage > 2, which held in none of 9 simulations.")
    assert "reached 2 in 2 of 9 simulations, first in simulation 7; the step from 2 to 3 was never" in counts


def test_what_was_met_at_another_time_is_not_called_missing() -> None:
    both = {"stage": [0, 1, 1, 0, 0], "locked": [0, 1, 1, 0, 0]}
    idle = {"stage": [0] * 5, "locked": [0] * 5}
    climb = climb_of("G[0,4] (stage > 0.5 -> locked > 0.5)", idle, both, idle, idle)
    assert climb.levels.is_plateau and len(climb.lines) == 1
    assert "stage > 0.5, which held in 1 of 4 simulations, first in simulation 2, but not" in climb.lines[0]


@pytest.mark.parametrize(
    ("course", "labels", "counts"),
    [
        (SECOND, {0: "Idle", 1: "Locked", 2: "Ready", 3: "Charging"}, True),
        (SECOND, {0: "Idle", 1: "Locked", 2: "Ready"}, False),  # there is no further step
        ([0, 2, 2, 0, 0], {0: "Idle", 1: "Locked", 2: "Ready", 3: "Charging"}, False),  # it leaps
        (SECOND, None, False),  # it always gets there, and nothing says that there is more
        ([0.0, 0.25, 0.5, 0.0, 0.0], None, False),  # scaled
    ],
)
def test_only_a_signal_that_counts_to_a_further_value_lacks_a_step(
    course: list[float], labels: dict[int, str] | None, counts: bool
) -> None:
    columns: Columns = {"stage": course, "x": [0.0] * 5}
    climb = climb_of("G[0,4] (x <= 3)", *[columns] * 4, labels=labels)
    assert any("the step from Ready to Charging was never made" in line for line in climb.lines) is counts
    assert len(climb.lines) == 1 + counts


def test_many_values_and_violations_are_not_told() -> None:
    rising = [{"stage": [0, 0, 0, 0, 0.1 * k]} for k in range(8)]
    assert not climb_of("G[0,4] (stage <= 2)", *rising).is_told
    assert not climb_of("G[0,4] (stage <= 1)", *COURSES).is_told


def test_a_run_on_a_staircase_is_told_by_coverage(tmp_path: Path) -> None:
    result = falsify(commands_problem(), "corners", budget=40, directory=tmp_path / "corners")
    assert not result.falsified
    found = coverage(tmp_path / "corners")
    text = coverage_text(found, "R")
    assert "robustness in 40 simulations: +0 in 3, first in simulation 3; +1 in 7, first in " in text
    assert "with stage = 3; a violation there takes stage > 3, which held in none of 40 simulations" in text
    assert "it reached 3 in 3 of 40 simulations, first in simulation 3; the step from 3 to 4 was" in text
    (told,) = coverage_json(found)["levels"]
    counts = [level["simulations"] for level in told["levels"]]
    assert (sum(counts), counts[0], len(told["missing"])) == (40, 3, 2)
    falsify(lag_problem("G[0,10] (x <= 2)", inputs=2), "uniform", budget=8, directory=tmp_path / "smooth")
    assert coverage_json(coverage(tmp_path / "smooth"))["levels"] == []


def test_a_prompt_tells_what_is_missing_under_the_names_that_it_uses() -> None:
    evaluations = [commanded(0, k) for k in range(6)] + [commanded(1, 2)] + [commanded(1, 5, 5)] * 5
    told, anonymous = (
        preview(commands_problem(), variant="MP5", evaluations=evaluations, anonymous=hidden)
        for hidden in (False, True)
    )
    text = told[1].content
    assert "Few values of robustness in 12 samples: +1 in 1, first in sample 7; " in text
    assert "takes stage > 3, which held in none of 12 samples." in text
    assert "stage counts up: it reached 2 in 1 of 12 samples, first in sample 7; the step from 2 to 3" in text
    assert sum(count_tokens(m.content) for m in told) <= 6000
    assert "stage" not in "".join(m.content for m in anonymous)
    assert "y1 counts up: it reached 2" in anonymous[1].content
    published = preview(commands_problem(), variant="MP4", evaluations=evaluations)
    assert "Few values" not in published[1].content
