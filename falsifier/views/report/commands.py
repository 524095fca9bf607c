"""Shell commands that repeat what a report shows."""

import shlex

from falsifier.campaigns.analysis import Run
from falsifier.problem.refinement import without_limits
from falsifier.problem.shorthand import options_from
from falsifier.problem.source import ProblemSource
from falsifier.search.request import LLMSettings, RunRequest


def replay_command(run: Run) -> str:
    """Shell command that replays a run's counterexample."""
    place = run.counterexample_file if run.shared else run.directory
    return shlex.join(["falsifier", "replay", str(place)])


def run_command(request: RunRequest, *, shared: bool = False) -> str:
    """Shell command that repeats a run; shared: for all requirements of its spec.

    >>> run_command(RunRequest(problems=(ProblemSource(target="AT1"),), engine="uniform"))
    'falsifier run AT1 --engine uniform --budget 100 --seed 0'
    """
    problem, budget = request.source, request.budget
    if problem is None:
        return "(no command: the problem was made in Python)"
    if shared and problem.stl is not None:
        return "(no command: these requirements were searched together in Python)"
    target = (problem.parts.file or problem.target.partition(":")[0]) if shared else problem.target
    options: list[tuple[str, object]] = [
        ("--stl", problem.stl),
        ("--parameterization", _parameterization(problem)),
        *options_from(without_limits(problem.changes) if request.levels else problem.changes),
        ("--engine", request.engine),
        *(_llm_options(request.llm) if request.llm else ()),
        ("--budget", budget.simulations),
        ("--seconds", budget.seconds),
        ("--max-tokens", budget.tokens),
        ("--max-cost", budget.cost),
        ("--seed", request.seed),
        ("--jobs", request.jobs if request.jobs > 1 else None),
        ("--refine", True if request.levels else None),
    ]
    words = ["falsifier", "run", target]
    for name, value in options:
        words += [] if value is None else [name] if value is True else [name, str(value)]
    return shlex.join(words)


def _parameterization(problem: ProblemSource) -> str | None:
    kind = "fixed" if problem.parameterization == "fixed" else None
    if problem.shortest_piece is not None:
        kind = f"free:{problem.shortest_piece:g}"
    return ",".join(word for word in (problem.profile, kind) if word) or None


def _llm_options(llm: LLMSettings) -> list[tuple[str, object]]:
    return [
        ("--llm", f"{llm.name}@{llm.effort}" if llm.effort else llm.name),
        ("--api-base", llm.api_base),
        ("--variant", llm.variant),
        *(("--llm-option", f"{name}={value}") for name, value in llm.options.items()),
        ("--llm-option", None if llm.price is None else f"price={llm.price[0]:g}:{llm.price[1]:g}"),
        ("--llm-option", None if llm.reply == "json" else f"reply={llm.reply}"),
        ("--anonymous", True if llm.anonymous else None),
        ("--fallback", llm.fallback),
    ]
