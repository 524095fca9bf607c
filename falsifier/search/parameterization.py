"""Which parameterization a search has, what a fixed one cannot express, and how to widen it."""

from collections.abc import Sequence

from falsifier.core.space import InputRange, SearchSpace
from falsifier.core.words import counted, parameterization_text
from falsifier.engines import DEFAULT_ENGINE, ENGINES
from falsifier.problem.grid import smallest_window
from falsifier.problem.problem import Problem
from falsifier.problem.refinement import coarse_inputs, limits_of
from falsifier.problem.source import Parameterization
from falsifier.search.findings import Finding
from falsifier.search.levels import Level, reached
from falsifier.search.request import LLMSettings

# The option that tries faster inputs after the slow ones.
_REFINE = "falsifier run ... --refine (slow inputs first, then faster ones)"


def engine_parameterization(engine: str | None, llm: LLMSettings | None) -> Parameterization:
    """Return ``fixed`` if what suggests candidates never chooses control points itself.

    Args:
        engine: name of an engine; an unknown one was made in Python and may choose them.
        llm: the language model; without an engine it leads the search.
    """
    if llm is None or engine == "hybrid":
        name = engine or DEFAULT_ENGINE
        return "fixed" if name in ENGINES and not ENGINES[name].is_free else "free"
    from falsifier.llm.prompts.variants import variant_named

    is_free = variant_named(llm.variant).has("freedom")
    is_free |= llm.fallback is not None and engine_parameterization(llm.fallback, None) == "free"
    return "free" if is_free else "fixed"


def searched_space(space: SearchSpace, engine: str | None, llm: LLMSettings | None) -> SearchSpace:
    """Return the space as it is searched: without freedom that is not used."""
    return space if engine_parameterization(engine, llm) == "free" else space.fixed


def parameterization_of(space: SearchSpace) -> Parameterization:
    """Return ``free`` if the control points of at least one input may be chosen."""
    return "free" if any(r.free for r in space.inputs) else "fixed"


def parameterization_note(space: SearchSpace) -> str:
    """Return in one line how the inputs are searched; empty without inputs."""
    told = [f"{r.name} {parameterization_text(r)}" for r in space.inputs]
    return f"{parameterization_of(space)} parameterization: {'; '.join(told)}" if told else ""


def inexpressible(problem: Problem, levels: Sequence[Level], simulations: int) -> Finding | None:
    """Return what the fixed control points of a search could not express; None if they left nothing out.

    Args:
        problem: what was searched.
        levels: the levels of the search, coarse first.
        simulations: number of simulations of the search.
    """
    formula = problem.requirement.formula
    begun = reached(levels, simulations)
    searched = begun[-1].space
    coarse = coarse_inputs(searched, limits_of([problem]))
    if not coarse:
        return None
    slow = "; ".join(_fastest(r, searched) for r in coarse)
    window = smallest_window([formula])
    against = "" if window is None else f". The formula's smallest window is {window:g} s"
    remedy = _remedy(problem, coarse)
    if len(begun) < len(levels):
        remedy = f"more simulations; the search ended on level {len(begun)} of {len(levels)}"
    elif begun[-1].leaves_finer:
        remedy = "a larger budget, which allows another level"
    return Finding(
        kind="parameterization",
        text=f"Faster inputs were not tried: {slow}{against}. To try them: {remedy}.",
    )


def _fastest(r: InputRange, space: SearchSpace) -> str:
    if r.control_points == 1:
        return f"{r.name} was constant"
    times = space.fixed_times(r)
    piece = times[1] - times[0]
    if r.interpolation == "constant":
        return f"{r.name} had {counted(r.control_points, 'held piece')} of {piece:.4g} s"
    return (
        f"{r.name} had {counted(r.control_points, 'control point')} ({r.interpolation}) and needed "
        f"{piece:.4g} s from {r.low:g} to {r.high:g}"
    )


def _remedy(problem: Problem, coarse: Sequence[InputRange]) -> str:
    """Say what allows faster inputs, depending on why there were none."""
    source, own = problem.source, {r.name: r for r in problem.space.inputs}
    if any(own[r.name].free for r in coarse):
        return f"--engine {DEFAULT_ENGINE}, which chooses control points itself"
    if source is not None and source.parameterization == "fixed":
        return "--parameterization free"
    stated = source.changes.inputs if source is not None else {}
    open_ = [r for r in coarse if r.name in stated]
    if open_:
        options = " ".join(f"--input {r.name}={r.low:g}:{r.high:g}" for r in open_)
        return f"{_REFINE}, or {options} without a number of control points"
    limits = limits_of([problem])
    count, shortest = limits.max_control_points, limits.min_interval
    if source is None:
        return f"falsify(..., refine=True), or InputRange(..., free=Freedom({count}, {shortest:g}))"
    if source.parts.kind == "python":
        return f"{_REFINE}, or InputRange(..., free=Freedom({count}, {shortest:g}))"
    free = f"free = {{ max_control_points = {count}, min_interval = {shortest:g} }}"
    return f"{_REFINE}, or {free} in [inputs.{coarse[0].name}]"
