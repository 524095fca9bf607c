"""From a problem and its evaluations to a prompt: what is told, and how it is put into blocks."""

import json
from collections.abc import Sequence

from falsifier.evaluation import Evaluation
from falsifier.llm.prompts.blocks import (
    AdviceBlock,
    DimensionLine,
    HistoryBlock,
    InputsBlock,
    OutputsBlock,
    Prompt,
    ReplyBlock,
    RequirementBlock,
    SampleLines,
    SignalLine,
    TaskBlock,
)
from falsifier.llm.prompts.numbers import bounds, decimals_for, number, plain, runs, signed
from falsifier.llm.prompts.variants import Variant
from falsifier.llm.prompts.view import View
from falsifier.signals import even_times
from falsifier.space import Candidate
from falsifier.trajectory import Trajectory

# Most recent samples that a prompt tells.
RECENT = 10


def build_prompt(
    view: View,
    variant: Variant,
    evaluations: Sequence[Evaluation],
    *,
    pending: Sequence[Candidate] = (),
    count: int = 1,
) -> Prompt:
    """Prompt for the next candidates.

    Args:
        view: the problem.
        variant: what is told.
        evaluations: what was simulated so far, in order.
        pending: candidates whose evaluations are not known yet.
        count: how many candidates are wanted.
    """
    return Prompt(
        variant=variant.name,
        task=TaskBlock(knows_requirement=variant.has("requirement"), count=count),
        requirement=_requirement(view) if variant.has("requirement") else None,
        outputs=_outputs(view) if variant.has("outputs") else None,
        inputs=_inputs(view, variant),
        history=_history(view, variant, evaluations, pending),
        advice=_advice(variant) if variant.has("advice") else None,
        reply=_reply(view, variant, count),
    )


def _requirement(view: View) -> RequirementBlock:
    return RequirementBlock(formula=str(view.requirement.formula))


def _outputs(view: View) -> OutputsBlock:
    searched = set(view.space.names)
    names = [name for name in view.requirement.formula.signals if name not in searched]
    return OutputsBlock(signals=tuple(SignalLine(name=name) for name in names))


def _inputs(view: View, variant: Variant) -> InputsBlock:
    dimensions = []
    for i, dimension in enumerate(view.space.dimensions, start=1):
        low, high = bounds(dimension.low, dimension.high)
        meaning = ""
        if variant.has("names"):
            at = "" if dimension.time is None else f" at t = {plain(dimension.time, _time_decimals(view))} s"
            meaning = f"{dimension.name}{at}"
        dimensions.append(DimensionLine(number=i, meaning=meaning, low=low, high=high))
    return InputsBlock(stop_time=number(view.space.stop_time), dimensions=tuple(dimensions))


def _time_decimals(view: View) -> int:
    return decimals_for(view.space.stop_time, 4)


def _history(
    view: View, variant: Variant, evaluations: Sequence[Evaluation], pending: Sequence[Candidate]
) -> HistoryBlock | None:
    told = [(i, e) for i, e in enumerate(evaluations, start=1) if e.verdict is not None]
    samples = tuple(_sample(view, variant, i, e) for i, e in told[-RECENT:])
    if not samples and not pending:
        return None
    return HistoryBlock(
        samples=samples,
        omitted=len(told) - len(samples),
        pending=tuple("; ".join(_chosen(view, variant, c)) for c in pending),
    )


def _sample(view: View, variant: Variant, index: int, evaluation: Evaluation) -> SampleLines:
    facts = []
    trajectory = evaluation.trajectory
    if variant.has("values") and trajectory is not None:
        facts += _values_at_control_points(view, trajectory)
    if variant.has("critical"):
        facts.append(_decided(view, evaluation))
    return SampleLines(
        number=index,
        inputs=_chosen(view, variant, evaluation.candidate),
        robustness=signed(evaluation.robustness or 0.0),
        facts=tuple(facts),
    )


def _chosen(view: View, variant: Variant, candidate: Candidate) -> tuple[str, ...]:
    if not variant.has("names"):
        return (f"point = {runs([float(v) for v in view.space.encode(candidate)])}",)
    signals = (f"{r.name} = {runs(candidate.signals[r.name].values)}" for r in view.space.inputs)
    parameters = (f"{p.name} = {number(candidate.parameters[p.name])}" for p in view.space.parameters)
    return (*signals, *parameters)


def _values_at_control_points(view: View, trajectory: Trajectory) -> list[str]:
    times = sorted(
        {
            t
            for r in view.space.inputs
            for t in even_times(
                r.control_points, stop_time=view.space.stop_time, interpolation=r.interpolation
            )
        }
    ) or [0.0, view.space.stop_time]
    lines = []
    for name in _formula_outputs(view):
        if name in trajectory.columns:
            column = trajectory[name]
            decimals = decimals_for(float(abs(column).max()))
            values = [f"{column[trajectory.index(t)]:.{decimals}f} at {_clock(view, t)}" for t in times]
            lines.append(f"{name}: {', '.join(values)}")
    return lines


def _decided(view: View, evaluation: Evaluation) -> str:
    verdict = evaluation.verdict
    assert verdict is not None
    values = []
    for name in view.requirement.formula.signals:
        if name in verdict.values:
            values.append(f"{name} = {_valued(evaluation.trajectory, name, verdict.values[name])}")
    with_values = f" with {', '.join(values)}" if values else ""
    return f"the robustness was decided at t = {_clock(view, verdict.critical_time)}{with_values}"


def _valued(trajectory: Trajectory | None, name: str, value: float) -> str:
    if trajectory is None or name not in trajectory.columns:
        return number(value)
    return f"{value:.{decimals_for(float(abs(trajectory[name]).max()))}f}"


def _formula_outputs(view: View) -> list[str]:
    return [name for name in view.requirement.formula.signals if name not in view.space.names]


def _clock(view: View, time: float) -> str:
    return f"{time:.{decimals_for(view.space.stop_time, 3)}f} s"


def _advice(variant: Variant) -> AdviceBlock:
    lines = ["Use the output values of the earlier samples to work out how each input moves the outputs."]
    if variant.has("critical"):
        lines.append(
            "Look at the time that decided each robustness value, and change the inputs so that the signals "
            "there move towards the wrong side."
        )
    return AdviceBlock(lines=tuple(lines))


def _reply(view: View, variant: Variant, count: int) -> ReplyBlock:
    space = view.space
    one: dict[str, object] = {"rationale": "why these values"}
    if not variant.has("names"):
        one["point"] = [_middle(d.low, d.high) for d in space.dimensions]
    else:
        if space.inputs:
            one["signals"] = [
                {"name": r.name, "values": [_middle(r.low, r.high)] * r.control_points} for r in space.inputs
            ]
        if space.parameters:
            one["parameters"] = [{"name": p.name, "value": _middle(p.low, p.high)} for p in space.parameters]
    return ReplyBlock(example=json.dumps(one if count == 1 else {"candidates": [one]}))


def _middle(low: float, high: float) -> float:
    return float(f"{(low + high) / 2:.4g}")
