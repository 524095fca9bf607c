"""MP1 to MP4: what the published prompts tell, in the same places and with the same digits.

``design/published-prompts.md`` compares line by line.
"""

from collections.abc import Iterator

from falsifier.core.candidate import Candidate
from falsifier.core.literals import shortest
from falsifier.core.ranges import InputRange, Range
from falsifier.core.signals import Signal
from falsifier.core.space import Dimension
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import counted
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.numbers import bounds, chosen, decimals_for
from falsifier.llm.prompts.standing import INTERPOLATION_WORDS, reply_form, requirement_text
from falsifier.llm.prompts.told_courses import compared_columns
from falsifier.llm.prompts.view import Variant, View
from falsifier.stl.formula import Formula

# They tell so many of the latest samples.
MOST_SAMPLES = 10
_DECIMALS = 3
# Decimals of an output: one, or as many as show that it is not zero.
_FEWEST_OF_OUTPUT, _MOST_OF_OUTPUT = 1, 3
# Decimals of a critical time: those of the times in the formula, up to this many.
_MOST_CLOCK_DECIMALS = 4
# Said of values where the sample had other control points than those that are told.
_READ = " (values at these times of an input with other control points)"

_TASK = (
    "Your task is to find {what} with which a system violates its specification. Each sample is judged by a "
    "number, its robustness: lower is better, and below 0 the specification is violated."
)
_GUIDANCE = "Consider which combinations of values had the lower robustness."
_GUIDANCE_ON_NUMBERS = "Consider what each number may stand for and how it may act on the system."
_GUIDANCE_ON_MEANING = (
    "Use the meaning of the {what} and of the requirement: how each of the {what} acts on the output "
    "signals, what the requirement demands of these, and what could break it."
)
_GUIDANCE_ON_OUTPUTS = (
    "Study the output values of the samples: how they follow the {what}, and whether they move towards a "
    "violation."
)


def standing(view: View, variant: Variant, *, count: int = 1) -> str:
    """Return the constant part of a question for so many candidates."""
    named, what = variant.has("names"), view.chosen
    sections = [_TASK.format(what=what if variant.has("requirement") else "values")]
    if variant.has("requirement"):
        sections.append(requirement_text(view.requirement.formula))
    if variant.has("outputs"):
        sections.append(_outputs(view))
    sections.append("\n".join(_numbers(view, named=named)))
    guidance = [_GUIDANCE, _GUIDANCE_ON_MEANING.format(what=what) if named else _GUIDANCE_ON_NUMBERS]
    if variant.has("values"):
        guidance.append(_GUIDANCE_ON_OUTPUTS.format(what=what))
    sections.append("\n".join(guidance))
    sections.append(reply_form(view, count, named=named, own=False))
    return "\n\n".join(sections)


def _outputs(view: View) -> str:
    names = ", ".join(
        f"{name} (0 is false, 1 is true)" if view.variable(name).kind == "boolean" else name
        for name in view.formula_outputs
    )
    return f"Output signals: {names or 'none; the requirement refers to inputs only.'}"


def _numbers(view: View, *, named: bool) -> Iterator[str]:
    """The numbers to choose, with or without their meanings."""
    dimensions = view.space.dimensions
    kinds = {r.name: r.kind for r in view.space.ranges}
    yield f"You choose {counted(len(dimensions), 'number')}."
    for i, dimension in enumerate(dimensions, start=1):
        low, high = bounds(dimension.low, dimension.high)
        at = "" if dimension.time is None else f" at t = {_clock(view, dimension.time)}"
        meaning = f": {dimension.name}{at}" if named else ""
        manner = ", searched in decades" if dimension.scale == "log" else ""
        boolean = named and kinds[dimension.name] == "boolean"
        yield f"{i}{meaning}, {'0 (false) or 1 (true)' if boolean else f'from {low} to {high}{manner}'}"
    for r in view.space.inputs if named else ():
        held = "" if r.hold is None else f", sampled and held every {r.hold:g} s"
        between = f"{r.name} between these times: {INTERPOLATION_WORDS[r.interpolation]}{held}"
        yield f"{r.name}: one value for the whole time" if r.control_points == 1 else between


def as_point(view: View, candidate: Candidate) -> tuple[str, ...]:
    """Return the numbers of a candidate in the order of the dimensions, as one line."""
    is_exact = all(_is_exact(view, r, candidate.signals[r.name]) for r in view.space.inputs)
    values = zip(view.space.encode(candidate), view.space.dimensions, strict=True)
    listed = ", ".join(_rounded(float(value), d) for value, d in values)
    return (f"point = [{listed}]{'' if is_exact else _READ}",)


def as_values(view: View, candidate: Candidate) -> tuple[str, ...]:
    """Return values of each input at the fixed control points, by name, and parameters, a line each."""
    lines = []
    for r in view.space.inputs:
        signal = candidate.signals[r.name]
        listed = ", ".join(_rounded(v, r) for v in view.space.fixed_values(r, signal))
        lines.append(f"{r.name} = [{listed}]{'' if _is_exact(view, r, signal) else _READ}")
    for p in view.space.parameters:
        lines.append(f"{p.name} = {_rounded(candidate.parameters[p.name], p)}")
    return tuple(lines)


def _rounded(value: float, ranged: Range | Dimension) -> str:
    """A value with the published three decimals; with more only if the range is too narrow for them."""
    return chosen(ranged, value, 2, least=_DECIMALS)


def _is_exact(view: View, r: InputRange, signal: Signal) -> bool:
    """Whether the values at the fixed control points say all about a signal."""
    return len(set(signal.values)) == 1 or view.space.is_fixed(r, signal)


def facts(view: View, variant: Variant, evaluation: Evaluation) -> Iterator[str]:
    """Lines on one judged sample: its robustness, what was compared when, and what decided."""
    verdict, trajectory = evaluation.verdict, evaluation.trajectory
    assert verdict is not None
    yield f"robustness {verdict.robustness:.{_DECIMALS}f}"
    told = {} if trajectory is None else _told_columns(view, trajectory)
    if variant.has("values") and trajectory is not None:
        times = {time for r in view.space.inputs for time in view.space.fixed_times(r)}
        for text, column in told.items():
            values = (
                f"{_output(column[trajectory.index(t)])} at {_clock(view, t)}"
                for t in sorted(times or {0.0, view.space.stop_time})
            )
            yield f"{text}: {', '.join(values)}"
    if variant.has("critical"):
        there = {name: verdict.values[name] for name in view.formula_outputs if name in verdict.values}
        if trajectory is not None:
            at = trajectory.index(verdict.critical_time)
            there = {text: float(column[at]) for text, column in told.items()}
        values = (f"{name} = {_output(value)}" for name, value in there.items())
        time = f"{verdict.critical_time:.{_clock_decimals(view.requirement.formula)}f} s"
        yield f"the robustness was decided at t = {time}{' with ' if there else ''}{', '.join(values)}"


def _told_columns(view: View, trajectory: Trajectory) -> dict[str, Array]:
    """Outputs of the formula; those that are compared only together, such as ``y5 - y4``, as one term.

    The published models have outputs for such terms.
    """
    columns: dict[str, Array] = {}
    for text, column in compared_columns(view, trajectory).items():
        names = view.compared[text].signals
        columns |= {text: column} if len(names) > 1 else {name: trajectory[name] for name in names}
    return columns


def _clock(view: View, time: float) -> str:
    """A time with one decimal; with more only if the simulation is too short for one."""
    return f"{time:.{max(1, decimals_for(view.space.stop_time, 2))}f} s"


def _clock_decimals(formula: Formula) -> int:
    limits = (shortest(limit) for window in formula.windows for limit in (window.start, window.end))
    return min(max((len(limit.partition(".")[2]) for limit in limits), default=0), _MOST_CLOCK_DECIMALS) or 1


def _output(value: float) -> str:
    texts = (f"{value:.{decimals}f}" for decimals in range(_FEWEST_OF_OUTPUT, _MOST_OF_OUTPUT + 1))
    last = _MOST_OF_OUTPUT if value else _FEWEST_OF_OUTPUT
    return next((text for text in texts if float(text)), f"{value:.{last}f}")
