"""Carry out a request: load its problem, make its proposer, open its record, run the loop."""

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path

from falsifier.engine import Result, search
from falsifier.errors import JournalError
from falsifier.events import Listener
from falsifier.execution import local_executor
from falsifier.journal import Journal, Record, open_journal, read_journal, read_manifest, write_manifest
from falsifier.manifest import Manifest, check_unchanged, manifest, recorded_request
from falsifier.problem import Problem
from falsifier.request import RunRequest
from falsifier.wiring import proposer_builder


def execute(
    request: RunRequest, directory: Path | None, *, listeners: Iterable[Listener] = (), resume: bool = False
) -> Result:
    """Run a request, recorded in a directory; with resume, go on where that directory's journal ends.

    Raises:
        JournalError: when the directory holds another run, or its FMU or spec has changed since.
        SpecError: when the request cannot be understood.
        ModelError: when the FMU cannot be used.
        ChatError: when the language model cannot be used, before the first simulation.
    """
    problem = request.problem.load()
    return perform(
        request, problem, manifest(request, problem), directory, listeners=listeners, resume=resume
    )


def perform(
    request: RunRequest,
    problem: Problem,
    described: Manifest,
    directory: Path | None,
    *,
    listeners: Iterable[Listener] = (),
    resume: bool = False,
    patience: float = 0.0,
) -> Result:
    """Run a request whose problem is loaded, like execute.

    Args:
        request: what to run.
        problem: of the request.
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
        build = proposer_builder(request, problem, records)
        if directory is not None and not begun:  # only now: a wrong engine or a missing key leaves no folder
            journal = stack.enter_context(open_journal(directory, keep=request.keep, patience=patience))
            write_manifest(directory, described.model_dump(mode="json"))
        executor = stack.enter_context(local_executor(request.jobs))
        stack.callback(problem.model.close)
        return search(
            problem,
            build,
            request.budget,
            batch=request.jobs,
            executor=executor,
            journal=journal,
            records=records,
            listeners=listeners,
        )


def resume_run(directory: Path, *, listeners: Iterable[Listener] = ()) -> Result:
    """Continue the run of a directory."""
    return execute(recorded_request(directory), directory, listeners=listeners, resume=True)
