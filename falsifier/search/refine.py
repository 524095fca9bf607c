"""A search that refines its inputs: how its budget is shared, and the engines of its levels."""

from collections.abc import Sequence
from dataclasses import replace

from falsifier.core.space import SearchSpace
from falsifier.engines.refining import Refining, Stage
from falsifier.llm.messages import Chat
from falsifier.problem.problem import Problem
from falsifier.problem.refinement import level_spaces
from falsifier.search.budget import DEFAULT_SIMULATIONS, Budget
from falsifier.search.levels import Level
from falsifier.search.make_engines import make_engines
from falsifier.search.parameterization import engine_parameterization, searched_space
from falsifier.search.request import LLMSettings, RunRequest


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


def levels_of(request: RunRequest, space: SearchSpace) -> tuple[Level, ...]:
    """Return the levels of a run; one with all that its engine can search if it does not refine."""
    if not request.levels:
        return (Level(0, searched_space(space, request.engine, request.llm)),)
    spaces = level_spaces(space, free=engine_parameterization(request.engine, request.llm) == "free")
    count = len(request.levels)
    return tuple(
        Level(first, each, leaves_finer=number == count < len(spaces))
        for number, (first, each) in enumerate(zip(request.levels, spaces, strict=False), start=1)
    )


def make_refining(
    request: RunRequest, problems: Sequence[Problem], levels: Sequence[Level], chat: Chat | None
) -> list[Refining]:
    """Make the engines of a request that refines its inputs, one per problem; see make_engines."""
    made = [
        make_engines(request, [replace(p, space=level.space) for p in problems], chat) for level in levels
    ]
    return [
        Refining([Stage(each[i], level.space, level.first) for each, level in zip(made, levels, strict=True)])
        for i in range(len(problems))
    ]
