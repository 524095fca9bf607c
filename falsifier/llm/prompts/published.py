"""What the published prompts tell of a sample: what was compared, when, and what decided.

The digits are theirs too; ``design/published-prompts.md`` compares line by line.
"""

from collections.abc import Iterator

from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.numbers import decimals_for
from falsifier.llm.prompts.observations import compared_columns
from falsifier.llm.prompts.view import Variant, View
from falsifier.stl.expression import number_text
from falsifier.stl.formula import Always, Eventually, Formula, Until

ROBUSTNESS_DECIMALS = 3
# Decimals of an output: one, or as many as show that it is not zero.
_FEWEST_DECIMALS, _MOST_DECIMALS = 1, 3
# Decimals of a critical time: those of the times in the formula, up to this many.
_MOST_CLOCK_DECIMALS = 4


def clock(view: View, time: float) -> str:
    """A time with one decimal, as published; with more only if the simulation is too short for one."""
    return f"{time:.{max(1, decimals_for(view.space.stop_time, 2))}f} s"


def published_facts(view: View, variant: Variant, evaluation: Evaluation) -> Iterator[str]:
    """Lines on one judged sample."""
    trajectory = evaluation.trajectory
    if variant.has("values") and trajectory is not None:
        yield from _values_at_control_points(view, trajectory)
    if variant.has("critical"):
        yield _decided(view, evaluation)


def _values_at_control_points(view: View, trajectory: Trajectory) -> Iterator[str]:
    stop_time = view.space.stop_time
    times = {time for r in view.space.inputs for time in view.space.fixed_times(r)}
    for text, column in _told_columns(view, trajectory).items():
        values = (
            f"{_output(view, column[trajectory.index(t)])} at {clock(view, t)}"
            for t in sorted(times or {0.0, stop_time})
        )
        yield f"{text}: {', '.join(values)}"


def _told_columns(view: View, trajectory: Trajectory) -> dict[str, Array]:
    """Outputs of the formula; those that are compared only together, such as ``y5 - y4``, as one term.

    The published models have outputs for such terms.
    """
    sides = {str(side): side for p in view.requirement.formula.predicates for side in (p.left, p.right)}
    columns: dict[str, Array] = {}
    for text, column in compared_columns(view, trajectory).items():
        names = sides[text].signals
        columns |= {text: column} if len(names) > 1 else {name: trajectory[name] for name in names}
    return columns


def _decided(view: View, evaluation: Evaluation) -> str:
    verdict, trajectory = evaluation.verdict, evaluation.trajectory
    assert verdict is not None
    if trajectory is None:
        there = {name: verdict.values[name] for name in view.formula_outputs if name in verdict.values}
    else:
        at = trajectory.index(verdict.critical_time)
        there = {text: float(column[at]) for text, column in _told_columns(view, trajectory).items()}
    values = ", ".join(f"{name} = {_output(view, value)}" for name, value in there.items())
    time = f"{verdict.critical_time:.{_clock_decimals(view.requirement.formula)}f} s"
    return f"the robustness was decided at t = {time}" + (f" with {values}" if values else "")


def _clock_decimals(formula: Formula) -> int:
    windows = [f.window for f in formula.walk() if isinstance(f, Always | Eventually | Until) and f.window]
    bounds = (number_text(bound) for window in windows for bound in (window.start, window.end))
    found = max((len(bound.partition(".")[2]) for bound in bounds), default=0)
    return min(found, _MOST_CLOCK_DECIMALS) or 1


def _output(view: View, value: float) -> str:
    fewest, most = _FEWEST_DECIMALS + view.more_decimals, _MOST_DECIMALS + view.more_decimals
    for decimals in range(fewest, most):
        if float(text := f"{value:.{decimals}f}"):
            return text
    if value == 0:
        return f"{0:.{fewest}f}"
    return f"{value:.{most}f}"
