"""From a problem and its evaluations to a prompt: selects what is shown and arranges it in blocks."""

from collections.abc import Iterator, Sequence
from functools import partial

from falsifier.core.candidate import Candidate
from falsifier.core.space import InputRange, ParameterRange
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.messages import ReplyKind
from falsifier.llm.prompts import choices, observations, selection
from falsifier.llm.prompts.advice import advice
from falsifier.llm.prompts.blocks import (
    BudgetBlock,
    ContextBlock,
    CourseLine,
    DimensionLine,
    ExcerptLines,
    HistoryBlock,
    InputLine,
    InputsBlock,
    OutputsBlock,
    ParameterLine,
    Prompt,
    RequirementBlock,
    SampleLines,
    SignalLine,
    SystemBlock,
    TaskBlock,
)
from falsifier.llm.prompts.circumstances import Circumstances
from falsifier.llm.prompts.numbers import bounds, number
from falsifier.llm.prompts.published import ROBUSTNESS_DECIMALS, clock, published_facts
from falsifier.llm.prompts.reply import reply_block
from falsifier.llm.prompts.variants import Variant
from falsifier.llm.prompts.view import View
from falsifier.stl import in_words
from falsifier.stl.margins import is_on_limit, margin_words, signed

# Control-point times listed individually; of longer lists the first ones and the last.
_MAX_TIMES = 25
_FEW_TIMES = 5


def build_prompt(
    view: View,
    variant: Variant,
    evaluations: Sequence[Evaluation],
    *,
    pending: Sequence[Candidate] = (),
    notes: Sequence[str] = (),
    count: int = 1,
    reply: ReplyKind = "json",
    circumstances: Circumstances | None = None,
) -> Prompt:
    """Build the prompt for the next candidates.

    Args:
        view: the problem.
        variant: which parts the prompt contains.
        evaluations: what was simulated so far, in order.
        pending: candidates without an evaluation yet.
        notes: lines about the search as a whole, from the engine that leads it.
        count: number of candidates wanted.
        reply: what a reply is to consist of.
        circumstances: what is known of the run; default: nothing.
    """
    circumstances = circumstances or Circumstances()
    return Prompt(
        variant=variant.name,
        task=TaskBlock(
            knows_requirement=variant.has("requirement"),
            is_published=variant.is_published,
            chosen=view.chosen,
            count=count,
        ),
        system=_system(view) if variant.has("system") else None,
        requirement=_requirement(view, variant) if variant.has("requirement") else None,
        outputs=_outputs(view, variant, circumstances) if variant.has("outputs") else None,
        inputs=_named_inputs(view, variant) if variant.has("system") else _dimensions(view, variant),
        context=_context(view) if variant.has("context") else None,
        history=_history(view, variant, evaluations, pending, notes, circumstances, reply),
        budget=_budget(variant, evaluations, circumstances),
        advice=advice(view, variant, is_flat=_is_flat(evaluations)),
        reply=reply_block(view, variant, count, reply),
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
        terms=tuple(str(e) for e in formula.expressions if set(e.signals) & set(view.formula_outputs)),
    )


def _budget(
    variant: Variant, evaluations: Sequence[Evaluation], circumstances: Circumstances
) -> BudgetBlock | None:
    if circumstances.simulations is None or not variant.has("circumstances"):
        return None
    return BudgetBlock(used=len(evaluations), limit=max(circumstances.simulations, len(evaluations)))


def _outputs(view: View, variant: Variant, circumstances: Circumstances) -> OutputsBlock:
    if not variant.has("system"):
        return OutputsBlock(signals=tuple(SignalLine(name=name) for name in view.formula_outputs))
    others = [n for n in view.experiment.outputs if n not in view.formula_outputs]
    return OutputsBlock(
        signals=tuple(
            SignalLine(
                name=name,
                unit=view.unit(name),
                description=view.description(name),
                kind=view.kind(name) if view.tells_kinds else "real",
                items=view.items(name),
                start=_start(view, variant, circumstances, name),
                known=_known(view, variant, name),
            )
            for name in (*view.formula_outputs, *others)
        ),
        legend=_legend(view) if variant.has("observations") else "",
    )


_LEGEND = (
    "Signals over time are written as time:value, time in s; between these points they run in straight "
    "lines. Where a signal oscillates, its period and its lower and upper envelope are given. Up to 2 % of a "
    "signal's span is rounded off, 4 % of a signal outside the requirement, 1 % around the time that "
    "decided, and more where it oscillates."
)


def _legend(view: View) -> str:
    """How signals over time are written."""
    horizon = _horizon(view)
    end = f" They are told up to {horizon} s, as the requirement looks no further." if horizon else ""
    return f"{_LEGEND}{end}"


def _start(view: View, variant: Variant, circumstances: Circumstances, name: str) -> str:
    """Value at time 0; a range if it depends on what is chosen."""
    if name not in circumstances.start or not variant.has("circumstances"):
        return ""
    low, high = (view.labelled(name, value, number(value, 5)) for value in circumstances.start[name])
    return low if low == high else f"{low} to {high}, depending on what you choose"


def _known(view: View, variant: Variant, name: str) -> tuple[str, ...]:
    """What the context files say of a signal."""
    return view.context.of(name) if variant.has("context") else ()


def _context(view: View) -> ContextBlock | None:
    if not view.context.excerpts:
        return None
    return ContextBlock(
        comparisons=tuple(c.text for c in view.context.comparisons if not c.signals),
        files=tuple(ExcerptLines(name=e.name, form=e.form, text=e.text) for e in view.context.excerpts),
    )


def _dimensions(view: View, variant: Variant) -> InputsBlock:
    """The numbers to choose, with or without their meanings."""
    dimensions = []
    for i, dimension in enumerate(view.space.dimensions, start=1):
        low, high = bounds(dimension.low, dimension.high)
        at = "" if dimension.time is None else f" at t = {clock(view, dimension.time)}"
        meaning = f"{dimension.name}{at}" if variant.has("names") else ""
        dimensions.append(DimensionLine(number=i, meaning=meaning, low=low, high=high))
    named = view.space.inputs if variant.has("names") else ()
    courses = (
        CourseLine(name=r.name, interpolation=r.interpolation, hold=r.hold, is_constant=r.control_points == 1)
        for r in named
    )
    return InputsBlock(dimensions=tuple(dimensions), courses=tuple(courses))


def _named_inputs(view: View, variant: Variant) -> InputsBlock:
    """The signals and parameters to choose, with everything known about them."""
    free = variant.has("freedom")
    known = partial(_known, view, variant)
    return InputsBlock(
        stop_time=number(view.space.stop_time),
        horizon=_horizon(view),
        inputs=tuple(_input(view, r, known(r.name), free=free) for r in view.space.inputs),
        parameters=tuple(_parameter(view, p, known(p.name)) for p in view.space.parameters),
    )


def _horizon(view: View) -> str:
    """Time up to which the requirement looks; empty if that is the end of the simulation."""
    return number(view.looked_at, 6) if view.looked_at < view.space.stop_time else ""


def _input(view: View, r: InputRange, known: tuple[str, ...], *, free: bool) -> InputLine:
    low, high = bounds(r.low, r.high)
    times = tuple(number(round(t, 6)) for t in view.space.fixed_times(r))
    if len(times) > _MAX_TIMES:
        times = (*times[:3], "...", times[-1])
    fixed = view.space.fixed_times(r)
    gap = fixed[1] - fixed[0] if len(fixed) > _FEW_TIMES else 0.0
    is_even = gap > 0 and all(abs(t - k * gap) < 1e-6 * view.space.stop_time for k, t in enumerate(fixed))
    freedom = r.free if free else None
    return InputLine(
        name=r.name,
        unit=r.unit,
        description=r.description,
        kind="levels" if r.name in view.levels else r.kind,
        items=_items(view, r),
        low=low,
        high=high,
        control_points=r.control_points,
        times=times,
        every=number(gap, 6) if is_even and free else "",
        interpolation=r.interpolation,
        hold=r.hold,
        max_control_points=freedom and freedom.max_control_points,
        min_interval=freedom and freedom.min_interval,
        known=known,
    )


def _parameter(view: View, p: ParameterRange, known: tuple[str, ...]) -> ParameterLine:
    low, high = bounds(p.low, p.high)
    nominal = "" if p.nominal is None else number(p.nominal)
    return ParameterLine(
        name=p.name,
        unit=p.unit,
        description=p.description,
        kind="levels" if p.name in view.levels else p.kind,
        items=_items(view, p),
        low=low,
        high=high,
        nominal=nominal,
        known=known,
    )


def _items(view: View, ranged: InputRange | ParameterRange) -> tuple[str, ...]:
    if ranged.name in view.levels:
        return tuple(number(level) for level in view.levels[ranged.name])
    return tuple(f"{n} = {name}" for name, n in ranged.items if ranged.low <= n <= ranged.high)


def _history(
    view: View,
    variant: Variant,
    evaluations: Sequence[Evaluation],
    pending: Sequence[Candidate],
    notes: Sequence[str],
    circumstances: Circumstances,
    reply: ReplyKind,
) -> HistoryBlock | None:
    if variant.has("selection"):
        chosen = selection.recent_best_and_different(view, evaluations)
        depths = selection.depths(chosen, evaluations)
    else:
        chosen = selection.recent(evaluations)
        depths = {}
    if not chosen and not pending and not notes:
        return None
    # The published prompts count the samples that they show, not all that there were.
    numbers = {i: n for n, i in enumerate(chosen)} if variant.is_published else {i: i for i in chosen}
    return HistoryBlock(
        samples=tuple(
            _sample(
                view, variant, numbers[i], mark, evaluations[i], depths.get(i, "close"), circumstances, reply
            )
            for i, mark in chosen.items()
        ),
        omitted=0 if variant.is_published else len(evaluations) - len(chosen),
        pending=tuple("; ".join(_chosen(view, variant, c, reply)) for c in pending),
        notes=(*(_notes(view, evaluations) if variant.has("observations") else ()), *notes),
    )


def _sample(
    view: View,
    variant: Variant,
    index: int,
    mark: str,
    evaluation: Evaluation,
    depth: selection.Depth,
    circumstances: Circumstances,
    reply: ReplyKind,
) -> SampleLines:
    inputs = _chosen(
        view,
        variant,
        evaluation.candidate,
        reply,
        in_brief=depth == "summary" or (depth == "plain" and not mark),
    )
    verdict = evaluation.verdict
    if verdict is None:
        return SampleLines(number=index + 1, mark=mark, inputs=inputs, failure=_failure(evaluation))
    rich = variant.has("observations")
    if rich:
        robustness = signed(verdict.robustness, observations.ROBUSTNESS_DIGITS)
        if is_on_limit(verdict.robustness):
            robustness += f" ({margin_words(verdict.robustness, verdict.predicate)})"
    else:
        robustness = f"{verdict.robustness:.{ROBUSTNESS_DECIMALS + view.more_decimals}f}"
    return SampleLines(
        number=index + 1,
        mark=mark,
        weight=selection.weight(mark, depth) if rich else 0,
        inputs=inputs,
        robustness=robustness,
        doubt=circumstances.doubts.get(evaluation.candidate.key, ""),
        facts=tuple(
            _observed(view, evaluation, depth) if rich else published_facts(view, variant, evaluation)
        ),
        details=(
            tuple(observations.details(view, evaluation, close=depth == "close"))
            if rich and depth != "summary"
            else ()
        ),
    )


def _observed(view: View, evaluation: Evaluation, depth: selection.Depth) -> Iterator[str]:
    if depth == "summary":
        return observations.summary(evaluation)
    return observations.facts(view, evaluation, close=depth == "close")


def _failure(evaluation: Evaluation) -> str:
    how = "timed out" if evaluation.status == "timeout" else evaluation.status
    return f"no verdict, the simulation {how}: {evaluation.reason}".rstrip(": ")


def _chosen(
    view: View, variant: Variant, candidate: Candidate, reply: ReplyKind, *, in_brief: bool = False
) -> tuple[str, ...]:
    if not variant.has("names") or (variant.is_published and reply == "points"):
        return choices.as_point(view, candidate)
    if not variant.has("system"):
        return choices.as_values(view, candidate)
    return choices.as_signals(view, candidate, in_brief=in_brief)


def _notes(view: View, evaluations: Sequence[Evaluation]) -> list[str]:
    """Observations about all samples together."""
    values = [e.robustness for e in evaluations if e.robustness is not None]
    if not _is_flat(evaluations):
        return []
    return [
        f"The robustness is flat: it was {signed(values[0], 3)} in all {len(values)} samples, so its value "
        "gives no direction. Look instead at how close a condition came to being true, how briefly a "
        "discrete value was held, and how far a signal was from its switching point."
    ]


def _is_flat(evaluations: Sequence[Evaluation]) -> bool:
    """Whether several samples have the same robustness, and none has another."""
    values = [e.robustness for e in evaluations if e.robustness is not None]
    return len(values) > 1 and len({f"{v:.9g}" for v in values}) == 1
