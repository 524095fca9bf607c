"""What the published prompts show of a sample: values at the control-point times, and what decided."""

from collections.abc import Iterator

from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.courses import column_decimals
from falsifier.llm.prompts.numbers import decimals_for, number
from falsifier.llm.prompts.variants import Variant
from falsifier.llm.prompts.view import View


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
    for name in view.formula_outputs:
        if name in trajectory.columns:
            column = trajectory[name]
            decimals = column_decimals(column)
            values = (
                f"{column[trajectory.index(t)]:.{decimals}f} at {_clock(view, t)}"
                for t in sorted(times or {0.0, stop_time})
            )
            yield f"{name}: {', '.join(values)}"


def _decided(view: View, evaluation: Evaluation) -> str:
    verdict = evaluation.verdict
    assert verdict is not None
    there = (
        f"{name} = {_valued(evaluation.trajectory, name, verdict.values[name])}"
        for name in view.requirement.formula.signals
        if name in verdict.values
    )
    values = ", ".join(there)
    return f"the robustness was decided at t = {_clock(view, verdict.critical_time)}" + (
        f" with {values}" if values else ""
    )


def _valued(trajectory: Trajectory | None, name: str, value: float) -> str:
    if trajectory is None or name not in trajectory.columns:
        return number(value)
    return f"{value:.{column_decimals(trajectory[name])}f}"


def _clock(view: View, time: float) -> str:
    return f"{time:.{decimals_for(view.space.stop_time, 3)}f} s"
