"""The entry points of the search: ``falsify`` starts a run, ``resume`` continues one."""

import logging
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import monotonic
from typing import overload

from falsifier.core.arguments import list_of, path_of, whole
from falsifier.core.candidate import Candidate
from falsifier.core.files import file_name
from falsifier.core.fitting import fit
from falsifier.core.space import SearchSpace
from falsifier.core.words import counted
from falsifier.engines import ENGINES
from falsifier.engines.protocol import KNOWN, Engine
from falsifier.errors import CandidateError, JournalError, SpecError, written
from falsifier.evaluation.evaluate import readable_internals
from falsifier.evaluation.workers import local_executor
from falsifier.llm.messages import Chat
from falsifier.problem.loading import load_source, note_named, reloadable
from falsifier.problem.problem import Problem, alike, check_names
from falsifier.problem.source import ProblemSource
from falsifier.record import manifest
from falsifier.record.files import CAMPAIGN, check_unused
from falsifier.record.journal import JOURNAL, STOP, check_new, holds_run, open_journal, simulated
from falsifier.record.records import EndedRecord
from falsifier.record.replay import replayed
from falsifier.search.budget import Budget, budget_of
from falsifier.search.events import Evaluated, Event, Listener, RunStarted
from falsifier.search.loop import search
from falsifier.search.make_engines import check_llm, make_engines, note_llm, told_problems
from falsifier.search.parameterization import engine_parameterization
from falsifier.search.request import LLMSettings, RunRequest
from falsifier.search.result import Result
from falsifier.search.steps import Steps

Falsifiable = Problem | ProblemSource | str | Path
LLM = LLMSettings | Chat | str

_LOG = logging.getLogger(__name__)

# Minimum time in s between two looks for a stop file.
_STOP_PERIOD = 0.2


# A text is a sequence of texts, too, but one target: the first that fits decides.
@overload
def falsify(  # type: ignore[overload-overlap]
    problem: Falsifiable,
    engine: str | Engine | None = ...,
    *,
    llm: LLM | None = ...,
    budget: Budget | int | None = ...,
    seed: int = ...,
    directory: Path | str | None = ...,
    jobs: int = ...,
    start_from: Iterable[Candidate] = ...,
    listeners: Iterable[Listener] = ...,
) -> Result: ...


@overload
def falsify(
    problem: Sequence[Falsifiable],
    engine: str | None = ...,
    *,
    llm: LLM | None = ...,
    budget: Budget | int | None = ...,
    seed: int = ...,
    directory: Path | str | None = ...,
    jobs: int = ...,
    start_from: Iterable[Candidate] = ...,
    listeners: Iterable[Listener] = ...,
) -> list[Result]: ...


def falsify(
    problem: Falsifiable | Sequence[Falsifiable],
    engine: str | Engine | None = None,
    *,
    llm: LLM | None = None,
    budget: Budget | int | None = None,
    seed: int = 0,
    directory: Path | str | None = None,
    jobs: int = 1,
    start_from: Iterable[Candidate] = (),
    listeners: Iterable[Listener] = (),
) -> Result | list[Result]:
    """Search for inputs that violate one requirement, or several.

    Requirements that differ in nothing else share a search: every simulation is judged against all of them,
    and they share one budget. Requirements that differ in what is varied or how it is simulated are searched
    in groups, one after the other, each with the full budget and its own directory below the given one.

    Args:
        problem: what to falsify: a Problem, or a target of ``falsifier run`` such as ``"AT1"``; or a list.
        engine: name of an engine, or for one requirement an engine made in Python; default: ``surrogate``,
            or the language model if one is given.
        llm: name of a language model such as ``"openai/gpt-5-mini"``, its settings, or a chat with it.
        budget: limits; a plain number limits the simulations. Default: 100 simulations.
        seed: seed of an engine given by name.
        directory: where to record the run, so that it can be resumed; None: no record.
        jobs: number of simulations at a time.
        start_from: known candidates, which are simulated first and count in the budget; they are fitted to
            the search space, and a warning of the log says what was changed.
        listeners: called with every event.

    Returns:
        One result, or for a list of problems a list of results in the same order.

    Raises:
        SpecError: if a problem, an engine, a language model or a number is not valid, or two names are equal.
        CandidateError: if an engine made in Python returns a candidate outside the search space, or one to
            start from does not fit it.
        ModelError: if the FMU cannot be used.
        ChatError: if the language model cannot be asked; raised before the first simulation.
        JournalError: if the directory is not empty; a run in it can be resumed.

    >>> falsify("AT1", budget=20).status  # doctest: +SKIP
    'falsified'
    """
    listed = None if isinstance(problem, Falsifiable) or not isinstance(problem, Iterable) else [*problem]
    problems = [_problem(each) for each in ([problem] if listed is None else listed)]
    if not problems:
        raise SpecError("problem: the list is empty; expected Problems, or targets such as 'AT1'")
    check_names(problems)
    seed, jobs = whole("seed", seed, least=0), whole("jobs", jobs, least=1)
    limits = Budget() if budget is None else budget_of(budget)
    groups, known = alike(problems), list_of("start_from", start_from, Candidate, "Candidate")
    listeners = list_of("listeners", listeners, Callable, "functions")
    chat = None if isinstance(llm, LLMSettings | str | None) else llm
    made = None if isinstance(engine, str) else engine
    _check_made(made)
    if llm is None and made is None and (limits.tokens or limits.cost):
        raise SpecError("budget: tokens and cost limit a language model, and none is named; drop the limit")
    name = engine if made is None else made.name
    settings = _settings(llm)
    base = None if directory is None else path_of("directory", directory)
    for source in [each.source for each in problems if base is not None and each.source is not None]:
        note_named(source)
    note_llm(settings if chat is None else None)
    if base is not None and len(groups) > 1:
        check_unused(base)
    requests = [
        RunRequest(
            problems=_sources(group) if directory is not None else (),
            engine=name,
            llm=settings,
            seed=seed,
            budget=limits,
            jobs=jobs,
            start_from=tuple(_fitted(group[0].space, each).to_json() for each in known),
        )
        for group in groups
    ]
    results: dict[str, Result] = {}
    for group, request in zip(groups, requests, strict=True):
        place = base / file_name(group[0].name) if base is not None and len(groups) > 1 else base
        found = carry_out(request, group, place, engine=made, chat=chat, listeners=listeners)
        results |= {result.problem.name: result for result in found}
        if any(result.status == "interrupted" for result in found):
            listeners = (*listeners, _interrupt)  # the others only begin, so that all of it can be resumed
    ordered = [results[each.name] for each in problems]
    return ordered[0] if listed is None else ordered


def resume(
    directory: Path | str,
    *,
    problems: Sequence[Problem] = (),
    engine: Engine | None = None,
    chat: Chat | None = None,
    budget: Budget | int | None = None,
    listeners: Iterable[Listener] = (),
) -> list[Result]:
    """Continue a recorded run; nothing that is recorded is simulated or asked again.

    Args:
        directory: run directory, or a folder of runs of one spec, which are continued one after the other.
        problems: what is searched, if it was made in Python: the problems of all these runs.
        engine: the engine, if it was made in Python: a new instance in its initial state.
        chat: chat with the language model, if it was made in Python.
        budget: limits of the whole run, including what is recorded; a plain number replaces the limit on
            simulations alone; default: the original limits.
        listeners: called with every event.

    Returns:
        One result per requirement; of a folder, not of the runs after one that was interrupted.

    Raises:
        JournalError: if the directory contains no run, or the FMU, the spec or the problem has changed.
        SpecError: if a run has more simulations already than the budget allows.
    """
    problems = list_of("problems", problems, Problem, "Problem")
    _check_made(engine)
    directory = path_of("directory", directory, "the directory of a run")
    places = runs_in(directory)
    by_name = {problem.name: problem for problem in problems}
    results: list[Result] = []
    found = [manifest.read(place) for place in places]
    limits = [d.request.budget for d in found]
    if budget is not None:  # of all, before any is continued
        limits = [_changed(old, budget, place) for old, place in zip(limits, places, strict=True)]
    for place, described, limit in zip(places, found, limits, strict=True):
        if any(result.status == "interrupted" for result in results):
            break
        request = described.request.model_copy(update={"budget": limit})
        if engine is None and request.llm is None and described.engine not in ENGINES:
            raise JournalError(f"{place}: its engine was made in Python: call resume() with engine=...")
        if engine is not None and engine.name != described.engine:
            raise JournalError(f"{place}: this run has the engine {described.engine!r}, not {engine.name!r}")
        check_llm(place, request.llm if chat is None else None)
        if not problems and not request.problems:
            raise JournalError(f"{place}: its problem was made in Python: call resume() with problems=[...]")
        if not problems:
            with manifest.loading(place, request.problems, described.hashes):
                loaded = [load_source(source) for source in request.problems]
        elif by_name.keys() >= set(described.names):
            loaded = [p for group in alike(by_name[name] for name in described.names) for p in group]
        else:
            raise JournalError(
                f"{place}: this run searched {', '.join(described.names)}: give all of them in problems=[...]"
            )
        results += carry_out(
            request, loaded, place, engine=engine, chat=chat, listeners=listeners, resume=True
        )
    return results


def runs_in(directory: Path) -> list[Path]:
    """Return a run directory, or those in a folder; JournalError if they are not of one spec and its FMUs."""
    if (directory / CAMPAIGN).exists():
        raise JournalError(f"{directory} is a campaign: resume_campaign({str(directory)!r}) continues it")
    found = [directory] if holds_run(directory) else manifest.runs_below(directory)
    known = [hashes for place in found if (hashes := manifest.read(place).hashes)]  # none if made in Python
    if any(hashes != known[0] for hashes in known):
        manifest.check_no_folder(directory)
    return found or [directory]


def _interrupt(event: Event) -> None:
    """Interrupt a run at its beginning, as Ctrl-C did with the one before."""
    if isinstance(event, RunStarted):
        raise KeyboardInterrupt


class StopFile:
    """Listener that interrupts a run, as Ctrl-C does, once a file says why; the run can be resumed."""

    def __init__(self, path: Path, budget: Budget) -> None:
        self._path, self._budget, self._looked = path, budget, monotonic()

    def __call__(self, event: Event) -> None:
        """Look for the file after a simulation, but not after the last one, nor each of very quick ones."""
        if isinstance(event, Evaluated) and monotonic() - self._looked > _STOP_PERIOD:
            self._looked = monotonic()
            with suppress(FileNotFoundError):
                why = self._path.read_text(encoding="utf-8", errors="replace").strip()
                if self._budget.exceeded(event.spent) is None:
                    raise KeyboardInterrupt(why)


def carry_out(
    request: RunRequest,
    problems: Sequence[Problem],
    directory: Path | None,
    *,
    hashes: dict[str, str] | None = None,
    engine: Engine | None = None,
    chat: Chat | None = None,
    listeners: Iterable[Listener] = (),
    resume: bool = False,
    patience: float = 0.0,
) -> list[Result]:
    """Carry out a request whose problems are loaded; for falsify, resume and the workers of campaigns.

    The problems differ only in their requirement; the hashes are of their files when they were loaded, None:
    as they are now. Engine and chat are given if they were made in Python. Without a directory, nothing is
    recorded. ``resume``: continue from the directory's journal; without a journal, start. Another process
    that writes to the directory is waited for, ``patience`` s at most.
    """
    if engine is not None and len(problems) > 1:
        raise SpecError(
            "an engine made in Python can search only one requirement: pass the name of an engine instead"
        )
    with ExitStack() as stack:
        begun = directory is not None and holds_run(directory)
        left = directory / JOURNAL if directory is not None and not begun else None
        if left is not None and left.exists() and left.stat().st_size:
            raise JournalError(
                f"{directory} contains a journal without its manifest, so its run is unknown: "
                "choose another directory, or delete it"
            )
        check = partial(check_new, resume="" if request.problems else "resume() with problems=[...]")
        if directory is not None and not resume:
            check(directory)
        # Before anything is written, so that a wrong engine or a missing key leaves no directory behind.
        recorded = manifest.read(directory) if begun and directory else None
        told = told_problems(request, problems, recorded.contexts if recorded else None)
        for problem in problems:
            stack.callback(problem.model.close)
        internals = recorded.internals if recorded else ()
        if recorded is None and engine is None:
            internals = readable_internals(problems, request.budget.seconds)
        engines = [engine] if engine is not None else make_engines(request, told, chat, internals)
        known = [replace(Candidate.from_json(each), origin=KNOWN) for each in request.start_from]
        steps = Steps(stack.enter_context(local_executor(request.jobs, problems[0].model)), internals)
        all_listeners = tuple(listeners)
        if directory is not None:
            described = manifest.describe(request, told, engines[0].name, internals, hashes)
            if recorded is not None:
                manifest.check_unchanged(directory, recorded.hashes, described.hashes)
                manifest.check_unchanged(directory, recorded.fingerprints, described.fingerprints)
            journal = stack.enter_context(open_journal(directory, keep=request.keep, patience=patience))
            if recorded is None:
                check(directory)  # another process may have begun a run there meanwhile
                manifest.write(directory, described)
            elif recorded.request.budget != request.budget and not any(
                isinstance(r, EndedRecord) and r.status == "falsified" for r in journal.records
            ):  # otherwise nothing is left to search with another one
                manifest.write(directory, recorded.model_copy(update={"request": request}))
            steps = replayed(directory, journal.records, steps)
            stop = directory / STOP
            stop.unlink(missing_ok=True)  # of an earlier process
            # What happens is recorded first, even if another listener raises.
            all_listeners = (journal, StopFile(stop, request.budget), *all_listeners)
        return search(
            problems,
            engines,
            request.budget,
            known=known,
            steps=steps,
            jobs=request.jobs,
            used=engine_parameterization(request.engine, request.llm),
            directory=directory,
            listeners=all_listeners,
        )


def _problem(given: object) -> Problem:
    if isinstance(given, Problem):
        return given
    if not isinstance(given, Falsifiable):
        raise SpecError(f"expected a Problem, a target such as 'AT1' or a list, got {type(given).__name__}")
    return load_source(given if isinstance(given, ProblemSource) else ProblemSource(target=str(given)))


def _check_made(engine: Engine | None) -> None:
    """Check that an engine made in Python, if one is given, has what an engine needs."""
    if isinstance(engine, type):
        raise SpecError(f"engine: expected an instance, such as {engine.__name__}(), got the class")
    methods = (getattr(engine, name, None) for name in ("ask", "tell"))
    if not (engine is None or (all(map(callable, methods)) and isinstance(getattr(engine, "name", 0), str))):
        expected = "an object with name, ask() and tell(), or in falsify() a name"
        raise SpecError(f"engine: expected {expected}, got {type(engine).__name__}")


def _sources(problems: Sequence[Problem]) -> tuple[ProblemSource, ...]:
    """Where the problems come from; empty if any of them was made or changed in Python."""
    sources = [reloadable(problem) for problem in problems]
    return tuple(s for s in sources if s is not None) if all(sources) else ()


def _changed(budget: Budget, given: Budget | int, place: Path) -> Budget:
    """The limits of a run that is continued with others; what it has spent stays spent."""
    if not isinstance(given, Budget):
        given = replace(budget, simulations=whole("budget", given, least=1))
    spent = simulated(place)
    if given.simulations is not None and given.simulations < spent:
        raise SpecError(
            f"{place}: this run has {counted(spent, 'simulation')} already, which count in the budget of "
            f"{given.simulations}: give at least {spent}"
        )
    return given


def _fitted(space: SearchSpace, candidate: Candidate) -> Candidate:
    given = written(f"--inputs {candidate.rationale}", "start_from")
    try:
        fitted = fit(space, candidate)
    except CandidateError as error:
        raise CandidateError(f"{given}: {error}") from None
    for note in fitted.notes:
        _LOG.warning("%s: %s", given, note)
    return fitted.candidate


def _settings(llm: LLM | None) -> LLMSettings | None:
    if llm is None or isinstance(llm, LLMSettings):
        return llm
    if not isinstance(llm, str) and not hasattr(llm, "llm"):
        raise SpecError(f"llm: expected a name, LLMSettings or a chat, got {llm!r}")
    if isinstance(llm, str):
        return LLMSettings(name=llm)
    return LLMSettings.model_construct(name=llm.llm)  # not with the environment's address: it has its own
