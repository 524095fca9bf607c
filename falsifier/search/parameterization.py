"""Which part of a search space an engine searches: it may choose control points itself, or not."""

from falsifier.core.space import SearchSpace
from falsifier.core.words import parameterization_text
from falsifier.engines import DEFAULT_ENGINE, ENGINES
from falsifier.problem.source import Parameterization
from falsifier.search.request import LLMSettings


def engine_parameterization(engine: str | None, llm: LLMSettings | None) -> Parameterization:
    """Return ``fixed`` if what suggests candidates never chooses control points itself.

    Args:
        engine: name of an engine; an unknown one was made in Python and may choose them.
        llm: the language model; without an engine it leads the search.
    """
    if llm is None or engine == "hybrid":
        name = engine or DEFAULT_ENGINE
        return "fixed" if name in ENGINES and not ENGINES[name].is_free else "free"
    from falsifier.llm.prompts.view import variant_named

    return "free" if variant_named(llm.variant).has("freedom") else "fixed"


def searched_space(space: SearchSpace, used: Parameterization) -> SearchSpace:
    """Return the space as it is searched: without freedom that the engine does not use."""
    return space if used == "free" else space.fixed


def parameterization_of(space: SearchSpace) -> Parameterization:
    """Return ``free`` if the control points of at least one input may be chosen."""
    return "free" if any(r.free for r in space.inputs) else "fixed"


def parameterization_note(space: SearchSpace) -> str:
    """Return in one line how the inputs are searched; empty without inputs."""
    told = [f"{r.name} {parameterization_text(r)}" for r in space.inputs]
    return f"{parameterization_of(space)} parameterization: {'; '.join(told)}" if told else ""
