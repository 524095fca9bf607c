"""Carry out a request: load its problem, make its engine, open its record, run the loop."""

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path

from falsifier.errors import JournalError
from falsifier.evaluation.workers import local_executor
from falsifier.problem.problem import Problem, alike
from falsifier.search.events import Listener
from falsifier.search.journal import (
    Journal,
    Record,
    open_journal,
    read_journal,
    read_manifest,
    write_manifest,
)
from falsifier.search.loop import search_together
from falsifier.search.manifest import Manifest, check_unchanged, manifest, recorded_request
from falsifier.search.request import RunRequest
from falsifier.search.result import Result
from falsifier.search.wiring import engine_builder


def execute(
    request: RunRequest, directory: Path | None, *, listeners: Iterable[Listener] = (), resume: bool = False
) -> list[Result]:
    """Run a request, recorded in a directory; with resume, go on where that directory's journal ends.

    Returns:
        one result for each requirement that the request names.

    Raises:
        JournalError: when the directory holds another run, or its FMU or spec has changed since.
        SpecError: when the request cannot be understood.
        ModelError: when the FMU cannot be used.
        ChatError: when the language model cannot be used, before the first simulation.
    """
    problems = request.problem.load_all(request.together) if request.together else [request.problem.load()]
    described = manifest(request, *problems)
    return perform(request, problems, described, directory, listeners=listeners, resume=resume)


def execute_all(request: RunRequest, directory: Path, *, listeners: Iterable[Listener] = ()) -> list[Result]:
    """Run a request for all requirements of its spec, like execute.

    Requirements that are searched and simulated alike share one search, with one budget; where a spec has
    several such groups, each has a search and a directory below of its own.
    """
    groups = alike(request.problem.load_all())
    results: list[Result] = []
    for group in groups:
        names = tuple(problem.name for problem in group)
        place = directory if len(groups) == 1 else directory / names[0]
        results += execute(request.model_copy(update={"together": names}), place, listeners=listeners)
    return results


def perform(
    request: RunRequest,
    problems: Sequence[Problem],
    described: Manifest,
    directory: Path | None,
    *,
    listeners: Iterable[Listener] = (),
    resume: bool = False,
    patience: float = 0.0,
) -> list[Result]:
    """Run a request whose problems are loaded, like execute; several problems are falsified together.

    Args:
        request: what to run.
        problems: of the request, alike but for their requirement.
        described: manifest of the request.
        directory: of the run; None: nothing is recorded.
        listeners: called with every event.
        resume: go on where the directory's journal ends; start where there is none.
        patience: how long in s to wait for another process that writes to the directory.
    """
    with ExitStack() as stack:
        journal: Journal | None = None
        records: Sequence[Record] = ()
        begun = directory is not None and (directory / "manifest.json").exists()
        if directory is not None and begun:
            if not resume:
                raise JournalError(
                    f"{directory} already holds a run: choose another --out, or continue it with "
                    f"'falsifier resume {directory}'"
                )
            journal = stack.enter_context(open_journal(directory, keep=request.keep, patience=patience))
            check_unchanged(directory, read_manifest(directory)["hashes"], described.hashes)
            records = read_journal(directory)
        build = engine_builder(request, problems, records)
        if directory is not None and not begun:  # only now: a wrong engine or a missing key leaves no folder
            journal = stack.enter_context(open_journal(directory, keep=request.keep, patience=patience))
            write_manifest(directory, described.model_dump(mode="json"))
        executor = stack.enter_context(local_executor(request.jobs))
        for problem in problems:
            stack.callback(problem.model.close)
        return search_together(
            problems,
            build,
            request.budget,
            batch=request.jobs,
            executor=executor,
            journal=journal,
            records=records,
            listeners=listeners,
        )


def resume_run(directory: Path, *, listeners: Iterable[Listener] = ()) -> list[Result]:
    """Continue the run of a directory."""
    return execute(recorded_request(directory), directory, listeners=listeners, resume=True)
