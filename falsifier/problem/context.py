"""What a problem names as context, and reading it: only for a language model or an engine that uses it."""

from dataclasses import replace
from pathlib import Path

from falsifier.context.values import NOTHING, Context, Named
from falsifier.core.files import seen_from_here
from falsifier.errors import warn_once
from falsifier.fmu import fmu_files
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from falsifier.problem.spec import Spec


def named_context(source: ProblemSource, spec: Spec | None = None, path: Path | None = None) -> Named:
    """Return what a spec and its user's options name as context; ``none`` leaves out what the spec names."""
    named = Named.of(source.context)
    if spec is None or path is None or NOTHING in source.context:
        return named
    stated = spec.context
    shown = {name: seen_from_here(path.parent / name) for name in stated.files}
    return Named(
        tuple(dict.fromkeys((*shown.values(), *named.files))),
        named.fmu or stated.fmu,
        (*(shown.get(name, name) for name in stated.checked), *named.checked),
    )


def with_context(problem: Problem, *, is_told: bool = True) -> Problem:
    """Return the problem with what its context files say.

    Unless a language model is told, only the crossings are kept, for engines, which send nothing.

    Raises:
        SpecError: naming the file that cannot be read, or the line that looks like a secret.
        ModelError: if an archive is damaged or dangerous.
    """
    from falsifier.context.gather import gather

    named = problem.named_context
    if not named or problem.context != Context():
        return problem
    seeds = problem.requirement.formula.signals
    found = gather(
        named.files,
        fmu_files(problem.model) if named.fmu else (),
        seeds=tuple(seeds),
        signals=tuple(dict.fromkeys((*seeds, *problem.experiment.outputs, *problem.space.names))),
        checked=named.checked,
        ranges={r.name: (r.low, r.high) for r in problem.space.ranges},
        is_told=is_told,
    )
    for note in found.notes:
        warn_once(note)
    return replace(problem, context=found)
