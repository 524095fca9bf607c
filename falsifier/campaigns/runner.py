"""Runs and resumes campaigns."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

from falsifier.campaigns.directory import (
    CampaignRecord,
    campaign_lock,
    read_campaign,
    run_directory,
    write_campaign,
)
from falsifier.campaigns.progress import Follower, Progress
from falsifier.campaigns.request import CampaignRequest, method_of
from falsifier.campaigns.schedule import PATIENCE, RunTask, Schedule
from falsifier.core.arguments import instance, list_of, path_of, whole
from falsifier.core.words import counted
from falsifier.counterexamples.store import keep_recorded
from falsifier.errors import SpecError, written
from falsifier.evaluation.workers import open_workers
from falsifier.llm.model_file import is_model_file, served
from falsifier.problem.loading import load_source, note_named
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from falsifier.record import manifest
from falsifier.record.journal import STOP, check_new, holds_run, open_journal
from falsifier.record.records import EndedRecord
from falsifier.record.summary import RunFollower, Summary
from falsifier.search.budget import Budget
from falsifier.search.make_engines import check_llm, check_names, check_price, note_llm, told_problems
from falsifier.search.request import RunRequest

Listener = Callable[[Progress], None]


@dataclass(frozen=True, slots=True)
class CampaignEnd:
    """How work on a campaign ended."""

    progress: Progress
    reason: str  # why it stopped before all runs were finished; empty if it did not


def run_campaign(
    request: CampaignRequest, directory: str | Path, *, jobs: int = 1, listeners: Iterable[Listener] = ()
) -> CampaignEnd:
    """Start a campaign.

    Args:
        request: what to run and what it may spend.
        directory: directory of the campaign.
        jobs: number of processes on this machine; each carries out one run at a time.
        listeners: called several times per second with the progress.

    Raises:
        JournalError: if the directory is in use or already contains a campaign.
        SpecError: if a problem, an engine or the number of jobs is not valid.
        ChatError: for an unknown provider or a missing key.
        ModelError: if an FMU cannot be used.
    """
    jobs, directory = whole("jobs", jobs, least=1), path_of("directory", directory)
    listeners = list_of("listeners", listeners, Callable, "functions")
    instance("request", request, CampaignRequest, "CampaignRequest(runs=...)")
    problems = check_request(request)
    with campaign_lock(directory):
        check_new(directory)
        for source in problems:
            note_named(source)
        for run in request.runs:
            note_llm(run.llm)
        record = CampaignRecord(**manifest.environment(), request=request, hashes=_hashes(problems))
        write_campaign(directory, record)
        return _work(directory, record, problems, jobs, listeners)


def resume_campaign(
    directory: str | Path, *, jobs: int = 1, limits: Budget | None = None, listeners: Iterable[Listener] = ()
) -> CampaignEnd:
    """Continue a campaign: finished runs are kept, the others are resumed from their journals.

    Args:
        directory: directory of the campaign.
        jobs: see run_campaign.
        limits: what all runs together may spend; None: the limits given at the start.
        listeners: see run_campaign.

    Raises:
        JournalError: if the directory is in use or contains no campaign, or an FMU or spec has changed.
        SpecError: see run_campaign.
        ModelError: see run_campaign.
    """
    jobs, directory = whole("jobs", jobs, least=1), path_of("directory", directory)
    listeners = list_of("listeners", listeners, Callable, "functions")
    instance("limits", limits, (Budget, type(None)), "a Budget")
    with campaign_lock(directory):
        record = read_campaign(directory)
        check_llm(directory, *(run.llm for run in record.request.runs))
        sources = (run.problems[0] for run in record.request.runs)
        with manifest.loading(directory, sources, record.hashes):
            problems = _load(record.request.runs)
        manifest.check_unchanged(directory, record.hashes, _hashes(problems))
        if limits is not None:
            request = record.request.model_copy(update={"limits": limits})
            record = record.model_copy(update={"request": request})
            _check_limits(record.request)
        return _work(directory, record, problems, jobs, listeners)


def _work(
    directory: Path,
    record: CampaignRecord,
    problems: Mapping[ProblemSource, Problem],
    jobs: int,
    listeners: tuple[Listener, ...],
) -> CampaignEnd:
    stop = directory / STOP
    stop.unlink(missing_ok=True)
    limits, follower, began, reason = record.request.limits, Follower(directory), perf_counter(), ""

    def stop_all(why: str) -> None:
        nonlocal reason
        reason = why
        stop.write_text(f"{why}\n", encoding="utf-8")  # workers look for this file

    def tick() -> bool:
        """Update listeners and limits; return whether the campaign may continue."""
        nonlocal reason
        progress = follower.look()
        for listener in listeners:
            listener(progress)
        if limits is not None and not reason:
            try:
                reached = limits.exceeded(replace(progress.spent, seconds=perf_counter() - began))
            except SpecError as error:  # a price is unknown
                reached = str(error)
            if reached is not None:
                stop_all(reached)
        if not reason and stop.exists():
            reason = stop.read_text(encoding="utf-8").strip() or "stopped by the user"
        return not reason

    def report(task: RunTask, failure: str) -> None:
        place = run_directory(directory, task.name)
        if failure:
            _record_failure(place, task, failure)
        keep_recorded(place, begun_here=True)

    requests = record.request.named()
    tasks, hashes = [], {source: manifest.file_hashes(problem) for source, problem in problems.items()}
    for run in follower.look().runs:
        if not run.finished:
            request = requests[run.name]
            source = request.problems[0]
            tasks.append(RunTask(run.name, request, problems[source], hashes[source], directory.absolute()))
        elif run.falsified:  # its counterexample is missing if the process was killed just after it ended
            keep_recorded(run_directory(directory, run.name), begun_here=True)
    with ExitStack() as stack:
        stack.callback(stop.unlink, missing_ok=True)
        schedule = Schedule(tasks, stack.enter_context(open_workers(jobs)))
        try:
            schedule.run(report, tick)
        except KeyboardInterrupt:
            stop_all("stopped by the user")
            schedule.run(report, lambda: False)
        except BaseException as error:  # such as a full disk: the workers, which are awaited, need not go on
            stop_all(f"{type(error).__name__}: {error}")
            raise
        progress = Follower(directory).look()  # Ctrl-C may have stopped the other one within a line
        for listener in listeners:
            listener(progress)
    if alone := progress.counts["interrupted"]:
        reason = reason or f"{counted(alone, 'run')} stopped alone"
    return CampaignEnd(progress, reason if progress.finished < len(progress.runs) else "")


def check_request(request: CampaignRequest) -> dict[ProblemSource, Problem]:
    """Check names and keys, load all problems and read their context files before anything is written.

    Returns:
        The problems, without what context files say.

    Raises:
        SpecError: for an unknown engine or prompt variant, a problem or context file that is not valid, or a
            cost limit although the price is unknown.
        ChatError: for an unknown provider, an option that it does not have, or a missing key.
        ModelError: if an FMU cannot be used.
    """
    from falsifier.llm.connect import preflight

    runs = tuple(request.named().values())
    for run in runs:
        check_names(run.engine, run.llm)
    for llm in {repr(r.llm): r.llm for r in runs if r.llm is not None}.values():
        preflight(llm.name, api_base=llm.api_base, options=llm.options)
        if is_model_file(llm.name):
            served(llm.name)  # by this process, so that those that it starts share the server
    _check_limits(request)
    problems = _load(runs)
    for run in {repr((r.problems[0], r.engine, r.llm)): r for r in runs}.values():
        told_problems(run, [problems[run.problems[0]]])
    return problems


def _check_limits(request: CampaignRequest) -> None:
    """Reject limits that could not be kept, before anything is paid for."""
    limits = request.limits
    if limits and (limits.tokens or limits.cost) and not any(run.llm for run in request.runs):
        stated = written("--total", "limits")
        raise SpecError(f"{stated}: tokens and cost limit language models, and none is named; drop the limit")
    total = limits.cost if limits else None
    asked = {repr((run.llm, run.budget.cost)): run for run in request.runs}.values()
    for run in asked:
        if run.llm is not None:
            check_price(run.llm, run.budget.cost or total)


def _load(requests: Iterable[RunRequest]) -> dict[ProblemSource, Problem]:
    """Load each problem once; SpecError for names that tables could not distinguish."""
    problems: dict[ProblemSource, Problem] = {}
    targets: dict[str, str] = {}
    for source in dict.fromkeys(r.problems[0] for r in requests):
        problem = problems[source] = load_source(source)
        other = targets.setdefault(problem.name, source.target)
        if other != source.target:
            raise SpecError(f"{other} and {source.target} are both named {problem.name!r}: rename one")
    return problems


def _hashes(problems: Mapping[ProblemSource, Problem]) -> dict[str, str]:
    return {path: digest for p in problems.values() for path, digest in manifest.file_hashes(p).items()}


def _record_failure(directory: Path, task: RunTask, reason: str) -> None:
    """Record in a run's journal why it failed, if its worker could not do so."""
    (summary,) = RunFollower(directory, [Summary()]).look()
    if summary.finished or (summary.status == "failed" and summary.reason.endswith(reason)):
        return
    with open_journal(directory, keep=task.request.keep, patience=PATIENCE) as journal:
        if not holds_run(directory):
            method = method_of(task.request).label
            manifest.write(
                directory, manifest.describe(task.request, [task.problem], method, hashes=task.hashes)
            )
        journal.write(EndedRecord(status="failed", reason=reason, spent=summary.spent))
