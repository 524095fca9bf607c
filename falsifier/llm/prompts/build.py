"""From a problem and its evaluations to a prompt: selects what is shown and arranges it in blocks."""

import json
from collections.abc import Sequence

from falsifier.core.candidate import Candidate
from falsifier.core.space import InputRange, ParameterRange, nearest_value
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts import choices, observations, selection
from falsifier.llm.prompts.advice import advice
from falsifier.llm.prompts.blocks import (
    DimensionLine,
    HistoryBlock,
    InputLine,
    InputsBlock,
    OutputsBlock,
    ParameterLine,
    Prompt,
    ReplyBlock,
    RequirementBlock,
    SampleLines,
    SignalLine,
    SystemBlock,
    TaskBlock,
)
from falsifier.llm.prompts.numbers import bounds, decimals_for, number, plain, signed
from falsifier.llm.prompts.published import published_facts
from falsifier.llm.prompts.variants import Variant
from falsifier.llm.prompts.view import View
from falsifier.stl import in_words

# Control-point times listed individually; of longer lists the first ones and the last.
_MAX_TIMES = 25


def build_prompt(
    view: View,
    variant: Variant,
    evaluations: Sequence[Evaluation],
    *,
    pending: Sequence[Candidate] = (),
    notes: Sequence[str] = (),
    count: int = 1,
) -> Prompt:
    """Build the prompt for the next candidates.

    Args:
        view: the problem.
        variant: which parts the prompt contains.
        evaluations: what was simulated so far, in order.
        pending: candidates without an evaluation yet.
        notes: lines about the search as a whole, from the engine that leads it.
        count: number of candidates wanted.
    """
    return Prompt(
        variant=variant.name,
        task=TaskBlock(knows_requirement=variant.has("requirement"), count=count),
        system=_system(view) if variant.has("system") else None,
        requirement=_requirement(view, variant) if variant.has("requirement") else None,
        outputs=_outputs(view, variant) if variant.has("outputs") else None,
        inputs=_named_inputs(view, variant) if variant.has("system") else _dimensions(view, variant),
        history=_history(view, variant, evaluations, pending, notes),
        advice=advice(view, variant) if variant.has("advice") else None,
        reply=_reply(view, variant, count),
    )


def _system(view: View) -> SystemBlock | None:
    info = view.info
    return (
        SystemBlock(name=info.name, description=info.description) if info.name or info.description else None
    )


def _requirement(view: View, variant: Variant) -> RequirementBlock:
    formula = view.requirement.formula
    if not variant.has("reading"):
        return RequirementBlock(formula=str(formula))
    return RequirementBlock(
        formula=str(formula),
        reading=in_words(formula),
        description=view.requirement.description,
        terms=tuple(str(e) for e in formula.expressions),
    )


def _outputs(view: View, variant: Variant) -> OutputsBlock:
    if not variant.has("system"):
        return OutputsBlock(signals=tuple(SignalLine(name=name) for name in view.formula_outputs))
    others = [n for n in view.experiment.outputs if n not in view.formula_outputs]
    return OutputsBlock(
        signals=tuple(
            SignalLine(
                name=name, unit=view.unit(name), description=view.description(name), kind=view.kind(name)
            )
            for name in (*view.formula_outputs, *others)
        )
    )


def _dimensions(view: View, variant: Variant) -> InputsBlock:
    """The numbers to choose, with or without their meanings."""
    clock = decimals_for(view.space.stop_time, 4)
    dimensions = []
    for i, dimension in enumerate(view.space.dimensions, start=1):
        low, high = bounds(dimension.low, dimension.high)
        at = "" if dimension.time is None else f" at t = {plain(dimension.time, clock)} s"
        meaning = f"{dimension.name}{at}" if variant.has("names") else ""
        dimensions.append(DimensionLine(number=i, meaning=meaning, low=low, high=high))
    return InputsBlock(stop_time=number(view.space.stop_time), dimensions=tuple(dimensions))


def _named_inputs(view: View, variant: Variant) -> InputsBlock:
    """The signals and parameters to choose, with everything known about them."""
    free = variant.has("freedom")
    return InputsBlock(
        stop_time=number(view.space.stop_time),
        inputs=tuple(_input(view, r, free=free) for r in view.space.inputs),
        parameters=tuple(_parameter(p) for p in view.space.parameters),
    )


def _input(view: View, r: InputRange, *, free: bool) -> InputLine:
    low, high = bounds(r.low, r.high)
    times = tuple(number(round(t, 6)) for t in view.space.fixed_times(r))
    if len(times) > _MAX_TIMES:
        times = (*times[:3], "...", times[-1])
    freedom = r.free if free else None
    return InputLine(
        name=r.name,
        unit=r.unit,
        description=r.description,
        kind=r.kind,
        items=_items(r),
        low=low,
        high=high,
        control_points=r.control_points,
        times=times,
        interpolation=r.interpolation,
        hold=r.hold,
        max_control_points=freedom and freedom.max_control_points,
        min_interval=freedom and freedom.min_interval,
    )


def _parameter(p: ParameterRange) -> ParameterLine:
    low, high = bounds(p.low, p.high)
    nominal = "" if p.nominal is None else number(p.nominal)
    return ParameterLine(
        name=p.name,
        unit=p.unit,
        description=p.description,
        kind=p.kind,
        items=_items(p),
        low=low,
        high=high,
        nominal=nominal,
    )


def _items(ranged: InputRange | ParameterRange) -> tuple[str, ...]:
    return tuple(f"{n} = {name}" for name, n in ranged.items if ranged.low <= n <= ranged.high)


def _history(
    view: View,
    variant: Variant,
    evaluations: Sequence[Evaluation],
    pending: Sequence[Candidate],
    notes: Sequence[str],
) -> HistoryBlock | None:
    if variant.has("selection"):
        chosen = selection.recent_best_and_different(view, evaluations)
    else:
        chosen = selection.recent(evaluations)
    if not chosen and not pending and not notes:
        return None
    judged = sum(e.verdict is not None or variant.has("failures") for e in evaluations)
    return HistoryBlock(
        samples=tuple(_sample(view, variant, i, mark, evaluations[i]) for i, mark in chosen.items()),
        omitted=judged - len(chosen),
        pending=tuple("; ".join(_chosen(view, variant, c)) for c in pending),
        notes=(*(_notes(view, evaluations) if variant.has("observations") else ()), *notes),
    )


def _sample(view: View, variant: Variant, index: int, mark: str, evaluation: Evaluation) -> SampleLines:
    inputs = _chosen(view, variant, evaluation.candidate)
    if evaluation.robustness is None:
        return SampleLines(number=index + 1, mark=mark, inputs=inputs, failure=_failure(evaluation))
    rich = variant.has("observations")
    digits = observations.ROBUSTNESS_DIGITS if rich else 3
    return SampleLines(
        number=index + 1,
        mark=mark,
        inputs=inputs,
        robustness=signed(evaluation.robustness, digits),
        facts=tuple(
            observations.facts(view, evaluation) if rich else published_facts(view, variant, evaluation)
        ),
        details=tuple(observations.details(view, evaluation)) if rich else (),
    )


def _failure(evaluation: Evaluation) -> str:
    how = "timed out" if evaluation.status == "timeout" else evaluation.status
    return f"no verdict, the simulation {how}: {evaluation.reason}".rstrip(": ")


def _chosen(view: View, variant: Variant, candidate: Candidate) -> tuple[str, ...]:
    if not variant.has("names"):
        return choices.as_point(view, candidate)
    return (choices.as_signals if variant.has("system") else choices.as_values)(view, candidate)


def _notes(view: View, evaluations: Sequence[Evaluation]) -> list[str]:
    """Observations about all samples together."""
    values = [e.robustness for e in evaluations if e.robustness is not None]
    distinct = {f"{v:.9g}" for v in values}
    if len(values) < 2 or len(distinct) > 1:
        return []
    return [
        f"The robustness is flat: it was {signed(values[0])} in all {len(values)} samples, so its value "
        "gives no direction. Look instead at how close a condition came to being true, how briefly a "
        "discrete value was held, and how far a signal was from its switching point."
    ]


def _reply(view: View, variant: Variant, count: int) -> ReplyBlock:
    space = view.space
    one: dict[str, object] = {"rationale": "why these values"}
    free = variant.has("freedom") and any(r.free for r in space.inputs)
    if not variant.has("names"):
        one["point"] = [_middle(d.low, d.high) for d in space.dimensions]
    else:
        if space.inputs:
            one["signals"] = [_example(r, free=free) for r in space.inputs]
        if space.parameters:
            one["parameters"] = [{"name": p.name, "value": _middle(p.low, p.high)} for p in space.parameters]
    example = json.dumps(one if count == 1 else {"candidates": [one]})
    return ReplyBlock(example=example, notes=_FREE_NOTES if free else ())


_FREE_NOTES = (
    'If "times" is empty, the values are evenly spaced control points from 0 to the stop time, however many '
    "there are; with constant interpolation they are pieces of equal length.",
    'Otherwise "times" gives the time in s of each value, increasing from 0; the last value is held to the '
    "stop time.",
    'A long repetition may be written as a run: "0 x 187" among the values stands for 187 zeros.',
)


def _example(r: InputRange, *, free: bool) -> dict[str, object]:
    middle = nearest_value(r, _middle(r.low, r.high))
    values = [middle] * min(r.control_points, _MAX_TIMES)
    if not free:
        return {"name": r.name, "values": [middle] * r.control_points}
    return {"name": r.name, "interpolation": r.interpolation, "times": [], "values": values}


def _middle(low: float, high: float) -> float:
    return float(f"{(low + high) / 2:.4g}")
