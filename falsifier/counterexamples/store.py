"""Counterexamples as small files: one each, readable, kept in a repository, run again at any time.

::

    counterexamples/AT.AT1/5f2c01ab.json      AT.toml's requirement AT1

A file says how its problem is loaded (relative to the file itself), what was simulated and what came out, so
that it can be run again after the FMU or the requirement has changed.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from os.path import relpath
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from falsifier import __version__
from falsifier.core.candidate import Candidate
from falsifier.core.files import write_whole
from falsifier.errors import CandidateError, JournalError, SimulationError, SpecError
from falsifier.evaluation.confirm import Confirmation, Outcome, confirm
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.loading import load_source, reloadable, spec_file
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from falsifier.search import manifest
from falsifier.search.journal import holds_run, read_journal, recorded_evaluations
from falsifier.search.manifest import RequirementRecord
from falsifier.search.records import ConfirmedRecord
from falsifier.stl.verdict import Verdict

FILE_NAME = "counterexample.json"

ReplayStatus = Literal["violates", "fragile", "does not violate", "does not fit"]

_STATUS: dict[Outcome, ReplayStatus] = {
    "confirmed": "violates",
    "fragile": "fragile",
    "refuted": "does not violate",
}


class StoredCounterexample(BaseModel):
    """Content of a counterexample file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    requirement: str
    formula: str
    problem: ProblemSource | None = Field(
        None, description="How to load the problem, paths relative to this file; null: only code can tell."
    )
    candidate: dict[str, Any]
    robustness: float = Field(allow_inf_nan=False)
    critical_time: float
    predicate: str
    outcome: Outcome
    reason: str
    fmu_sha256: str | None = None
    falsifier: str = __version__


@dataclass(frozen=True, slots=True)
class Replayed:
    """What became of a stored counterexample today.

    Attributes:
        status: ``violates`` (confirmed), ``fragile`` (only at the given communication step),
            ``does not violate``, or ``does not fit``: the problem has other inputs, ranges or control points.
        confirmation: of today's simulation; None where it does not violate.
        evaluation: today's simulation; None where the counterexample does not fit.
        text: in words, with what has changed since the counterexample was stored.
    """

    status: ReplayStatus
    confirmation: Confirmation | None
    evaluation: Evaluation | None
    text: str


def to_store(confirmation: Confirmation) -> StoredCounterexample:
    """Content of the file for a confirmed or fragile violation.

    Raises:
        ValueError: when the evaluation has no verdict.
    """
    problem, evaluation = confirmation.problem, confirmation.evaluation
    if evaluation.verdict is None:
        raise ValueError("a simulation that failed is no counterexample")
    return _content(
        RequirementRecord.of(problem.requirement),
        reloadable(problem),
        evaluation.candidate,
        evaluation.verdict,
        outcome=confirmation.outcome,
        reason=confirmation.reason,
        fmu_sha256=getattr(problem.model, "sha256", None),
    )


def _content(
    requirement: RequirementRecord,
    source: ProblemSource | None,
    candidate: Candidate,
    verdict: Verdict,
    *,
    outcome: Outcome,
    reason: str,
    fmu_sha256: str | None,
) -> StoredCounterexample:
    return StoredCounterexample(
        requirement=requirement.name,
        formula=requirement.formula,
        problem=source,
        candidate=candidate.to_json(),
        robustness=verdict.robustness,
        critical_time=verdict.critical_time,
        predicate=verdict.predicate,
        outcome=outcome,
        reason=reason,
        fmu_sha256=fmu_sha256,
    )


def save(stored: StoredCounterexample, path: Path) -> Path:
    """Write a counterexample file in one step; the problem's paths are made relative to it."""
    request = stored.problem and _seen_from(stored.problem, path.parent)
    content = stored.model_copy(update={"problem": request}).model_dump(mode="json")
    return write_whole(path, json.dumps(content, indent=2) + "\n")


def load(path: Path) -> StoredCounterexample:
    """Read a counterexample file; of a run directory, the counterexample that the run found.

    Raises:
        SpecError: naming the file and what is wrong with it.
    """
    file = counterexample_file(path)
    try:
        stored = StoredCounterexample.model_validate_json(file.read_bytes())
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise SpecError(f"not a counterexample file: {first['msg']}", file=str(file), key=key) from None
    return stored.model_copy(update={"problem": stored.problem and _found_from(stored.problem, file.parent)})


def counterexample_file(path: Path) -> Path:
    """Path of a counterexample file, given itself or its run directory.

    Runs that were killed, and those of a campaign, keep a journal only; what they found is written from it.

    Raises:
        SpecError: when there is none, or more than one.
    """
    directory = path if path.is_dir() else path.parent
    if not path.is_file():
        keep_recorded(directory)
    if not path.is_dir():
        if not path.is_file():
            raise SpecError(
                "there is no such file; give a run directory or a counterexample file", file=str(path)
            )
        return path
    found = sorted(path.glob("counterexample*.json"))
    if len(found) > 1:
        names = ", ".join(str(f) for f in found)
        raise SpecError(f"this run has several counterexamples, give one of them: {names}", file=str(path))
    if not found:
        raise SpecError("this run has found no confirmed counterexample", file=str(path))
    return found[0]


def file_name(requirement: str = "") -> str:
    """Name of the counterexample's file in a run directory; of one requirement where several shared a search.

    >>> file_name(), file_name("AT1")
    ('counterexample.json', 'counterexample-AT1.json')
    """
    return f"counterexample-{requirement}.json" if requirement else FILE_NAME


def keep_recorded(directory: Path) -> None:
    """Write the counterexamples of a run directory's journal that have no file yet.

    Runs that were killed, and those of a campaign, keep a journal only; a directory of no run is left alone.
    """
    if not holds_run(directory):
        return
    described = manifest.read(directory)
    records = read_journal(directory)
    evaluations: dict[str, list[Evaluation]] = {}
    for record in records:
        if not isinstance(record, ConfirmedRecord) or record.outcome != "confirmed":
            continue
        name = record.requirement
        file = directory / file_name(name if described.shared else "")
        if file.exists():
            continue
        if name not in evaluations:
            evaluations[name] = recorded_evaluations(directory, records, name)
        evaluation, alone = evaluations[name][record.index], described.of(name)
        if evaluation.verdict is None:
            raise JournalError(f"{directory}: the journal has no verdict of the counterexample of {name}")
        content = _content(
            alone.requirement,
            alone.request.source,
            evaluation.candidate,
            evaluation.verdict,
            outcome="confirmed",
            reason=record.reason,
            fmu_sha256=described.fmu_sha256,
        )
        save(content, file)


def problem_of(stored: StoredCounterexample) -> Problem:
    """Load the problem of a counterexample.

    Raises:
        SpecError: when the file does not say how, or the spec cannot be loaded any more.
    """
    if stored.problem is None:
        raise SpecError(
            f"this counterexample of {stored.requirement} is of a problem made in Python: run the test that "
            "found it"
        )
    return load_source(stored.problem)


def replay(stored: StoredCounterexample, problem: Problem) -> Replayed:
    """Simulate a stored counterexample today, and confirm it where it violates.

    Raises:
        SimulationError: when the simulation fails.
    """
    changes = "".join(f"; {change}" for change in _changes(stored, problem))
    try:
        candidate = problem.space.admit(Candidate.from_json(stored.candidate))
    except CandidateError as error:
        return Replayed("does not fit", None, None, f"{problem.name} does not fit: {error}{changes}")
    evaluation = evaluate(problem, candidate)
    if evaluation.robustness is None:
        raise SimulationError(f"{problem.name}: the simulation {evaluation.status}: {evaluation.reason}")
    confirmation = confirm(problem, evaluation) if evaluation.violated else None
    status = _STATUS[confirmation.outcome if confirmation else "refuted"]
    text = f"{problem.name} {status}: robustness {evaluation.robustness:+.6g}, was {stored.robustness:+.6g}"
    text += f"; {confirmation.reason}" if confirmation else ""
    return Replayed(status, confirmation, evaluation, text + changes)


@dataclass(frozen=True, slots=True)
class Database:
    """A folder of counterexample files, one folder a requirement.

    Attributes:
        folder: the folder; it need not exist.
    """

    folder: Path

    def save(self, problem: Problem, stored: StoredCounterexample) -> Path:
        """Write a counterexample; an equal one is written over."""
        key = repr(Candidate.from_json(stored.candidate).key)
        return save(stored, self._place(problem) / f"{sha256(key.encode()).hexdigest()[:8]}.json")

    def fetch(self, problem: Problem) -> Iterator[tuple[Path, StoredCounterexample]]:
        """Yield the stored counterexamples of a problem, by file name."""
        for path in sorted(self._place(problem).glob("*.json")):
            yield path, load(path)

    def _place(self, problem: Problem) -> Path:
        spec = None if problem.source is None else spec_file(problem.source)
        return self.folder / (f"{spec.stem}.{problem.name}" if spec else problem.name)


def _changes(stored: StoredCounterexample, problem: Problem) -> Iterator[str]:
    digest = getattr(problem.model, "sha256", None)
    if stored.fmu_sha256 is not None and digest != stored.fmu_sha256:
        yield "the FMU has changed since"
    formula = str(problem.requirement.formula)
    if formula != stored.formula:
        yield f"the requirement was {stored.formula} then and is {formula} now"


def _split(target: str) -> tuple[Path | None, str]:
    """File of a problem's target, None where it is a bundled name, and the rest, with its colon."""
    if target.endswith((".toml", ".fmu")):
        return Path(target), ""
    file, colon, requirement = target.rpartition(":")
    return (Path(file), f":{requirement}") if colon and file.endswith(".toml") else (None, "")


def _seen_from(request: ProblemSource, folder: Path) -> ProblemSource:
    """Return the request with its file as seen from a folder."""
    file, requirement = _split(request.target)
    if file is None:
        return request
    seen = Path(relpath(file.resolve(), folder.resolve())).as_posix()
    return request.model_copy(update={"target": f"{seen}{requirement}"})


def _found_from(request: ProblemSource, folder: Path) -> ProblemSource:
    """Return the request with its file, which is given as seen from a folder, as found from here."""
    file, requirement = _split(request.target)
    return request if file is None else request.model_copy(update={"target": f"{folder / file}{requirement}"})
