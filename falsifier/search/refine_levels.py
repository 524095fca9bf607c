"""The levels of a search that refines its inputs: what it searches, and from which simulation on."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan

from falsifier.core.space import SearchSpace
from falsifier.core.words import counted, parameterization_text
from falsifier.engines import DEFAULT_ENGINE, ENGINES
from falsifier.problem.refinement import level_spaces
from falsifier.problem.source import Parameterization
from falsifier.search import DEFAULT_SIMULATIONS
from falsifier.search.budget import Budget
from falsifier.search.request import LLMSettings, RunRequest


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


@dataclass(frozen=True, slots=True)
class RefineLevel:
    """One level of a search; a search that does not refine its inputs has one.

    Attributes:
        first: number of simulations before it.
        space: the part of the search space that it searches.
        leaves_finer: whether the budget allowed no level after it, although there are finer inputs.
    """

    first: int
    space: SearchSpace
    leaves_finer: bool = False

    @property
    def searched(self) -> str:
        """How it searches the inputs, in words."""
        return parameterization_note(self.space)


def reached(levels: Sequence[RefineLevel], simulations: int) -> tuple[RefineLevel, ...]:
    """Return the levels that a run of so many simulations has begun; at least the first."""
    return tuple(level for level in levels if level.first < max(simulations, 1))


def level_name(number: int, count: int) -> str:
    """Return what a level is called, given its number from 1."""
    return f"level {number} of {count}"


@dataclass(frozen=True, slots=True)
class LevelResult:
    """What came of one level.

    Attributes:
        name: which level it is.
        searched: how it searched the inputs, in words.
        simulations: number of its simulations.
        smallest: smallest robustness of these; None if there is none.
        falsified: whether the requirement was falsified on this level.
    """

    name: str
    searched: str
    simulations: int
    smallest: float | None
    falsified: bool

    @property
    def text(self) -> str:
        """The outcome, and what was searched, in words."""
        count = counted(self.simulations, "simulation")
        if self.falsified:
            came = f"falsified after {count}"
        elif not self.simulations:
            came = "not begun"
        elif self.smallest is None:
            came = f"{count}, all failed"
        else:
            came = f"{count}, smallest robustness {self.smallest:+.6g}"
        return f"{came}: {self.searched}"


def level_results(
    levels: Sequence[tuple[int, str]], robustness: Sequence[float | None], *, falsified: bool
) -> list[LevelResult]:
    """Return what came of each level.

    Args:
        levels: of each level, the number of simulations before it, and how it searched the inputs.
        robustness: of each simulation of the run, up to the counterexample; None or NaN without a verdict.
        falsified: whether the last of these is a counterexample.
    """
    found = []
    ends = [*(first for first, _ in levels[1:]), len(robustness)]
    for number, ((first, searched), end) in enumerate(zip(levels, ends, strict=True), start=1):
        own = robustness[first:end]
        smallest = min((value for value in own if value is not None and not isnan(value)), default=None)
        is_last = bool(len(own)) and first + len(own) == len(robustness)
        name = level_name(number, len(levels))
        found.append(LevelResult(name, searched, len(own), smallest, falsified and is_last))
    return found


def level_starts(
    space: SearchSpace, engine: str | None, llm: LLMSettings | None, budget: Budget
) -> tuple[int, ...]:
    """Return the number of simulations before each level: all get the same share of the budget.

    Without a limit on simulations, they begin as with the default budget.
    """
    count = len(level_spaces(space, free=engine_parameterization(engine, llm) == "free"))
    total = budget.simulations or DEFAULT_SIMULATIONS
    starts = (-(-total * k // count) for k in range(count))
    return tuple(start for start in dict.fromkeys(starts) if start < total)


def levels_of(request: RunRequest, space: SearchSpace) -> tuple[RefineLevel, ...]:
    """Return the levels of a run; one with all that its engine can search if it does not refine."""
    if not request.levels:
        return (RefineLevel(0, searched_space(space, request.engine, request.llm)),)
    spaces = level_spaces(space, free=engine_parameterization(request.engine, request.llm) == "free")
    count = len(request.levels)
    return tuple(
        RefineLevel(first, each, leaves_finer=number == count < len(spaces))
        for number, (first, each) in enumerate(zip(request.levels, spaces, strict=False), start=1)
    )
