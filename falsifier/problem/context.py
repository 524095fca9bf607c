"""What a problem names as context, and reading it: only when a language model is to be asked."""

from dataclasses import replace
from os.path import relpath
from pathlib import Path

from falsifier.context.gather import gather
from falsifier.context.values import Context, Named
from falsifier.fmu import fmu_files
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from falsifier.problem.spec import Spec

# What --context takes beside files.
INSIDE, NOTHING = "fmu", "none"


def named_context(source: ProblemSource, spec: Spec | None = None, path: Path | None = None) -> Named:
    """Return what a spec and its user's options name as context.

    Args:
        source: the options; ``none`` among them leaves out what the spec names.
        spec: the spec, if there is one.
        path: its file, to which its paths are relative.
    """
    files: list[str] = []
    within = INSIDE in source.context
    if spec is not None and path is not None and NOTHING not in source.context:
        files += [_shown(path.parent / name) for name in spec.context.files]
        within = within or spec.context.fmu
    files += [name for name in source.context if name not in (INSIDE, NOTHING)]
    return Named(tuple(dict.fromkeys(files)), within)


def with_context(problem: Problem) -> Problem:
    """Return the problem with what its context files say, cut to what its requirement depends on.

    Raises:
        SpecError: naming the file that cannot be read, or the line that looks like a secret.
        ModelError: if an archive is damaged or dangerous.
    """
    if not problem.named_context or problem.context != Context():
        return problem
    seeds = problem.requirement.formula.signals
    signals = dict.fromkeys((*seeds, *problem.experiment.outputs, *problem.space.names))
    fmus = fmu_files(problem.model) if problem.named_context.fmu else {}
    found = gather(problem.named_context.files, fmus, seeds=tuple(seeds), signals=tuple(signals))
    return replace(problem, context=found)


def _shown(path: Path) -> str:
    """Path as the user sees it: relative to here if it is below."""
    short = relpath(path)
    return str(path) if short.startswith("..") else short
