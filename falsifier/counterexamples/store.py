"""Counterexamples as small files: one each, readable, kept in a repository, run again at any time.

::

    counterexamples/AT.AT1/5f2c01ab.json      AT.toml's requirement AT1

A file says how its problem is loaded (relative to the file itself), what was simulated and what came out, so
that it can be run again after the FMU or the requirement has changed.
"""

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from os.path import relpath
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from falsifier import __version__
from falsifier.core.candidate import Candidate
from falsifier.errors import CandidateError, SimulationError, SpecError
from falsifier.evaluation.confirm import Confirmation, Outcome, confirm
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem
from falsifier.search.journal import ConfirmedRecord, read_journal, read_manifest, recorded_evaluations
from falsifier.search.manifest import Manifest
from falsifier.search.request import ProblemRequest

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
    problem: ProblemRequest | None = Field(
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


def to_store(
    problem: Problem, confirmation: Confirmation, request: ProblemRequest | None
) -> StoredCounterexample:
    """Content of the file for a confirmed or fragile violation.

    Raises:
        ValueError: when the evaluation has no verdict.
    """
    evaluation = confirmation.evaluation
    if evaluation.verdict is None:
        raise ValueError("a simulation that failed is no counterexample")
    return StoredCounterexample(
        requirement=problem.name,
        formula=str(problem.requirement.formula),
        problem=request,
        candidate=evaluation.candidate.to_json(),
        robustness=evaluation.verdict.robustness,
        critical_time=evaluation.verdict.critical_time,
        predicate=evaluation.verdict.predicate,
        outcome=confirmation.outcome,
        reason=confirmation.reason,
        fmu_sha256=getattr(problem.model, "sha256", None),
    )


def save(stored: StoredCounterexample, path: Path) -> Path:
    """Write a counterexample file in one step; the problem's paths are made relative to it."""
    request = stored.problem and _seen_from(stored.problem, path.parent)
    content = stored.model_copy(update={"problem": request}).model_dump(mode="json")
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    partial.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    partial.replace(path)
    return path


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
    if not path.is_file() and (directory / "manifest.json").exists():
        _keep_recorded(directory)
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


def _keep_recorded(directory: Path) -> None:
    """Write the counterexamples of a run directory's journal that have no file yet."""
    records = read_journal(directory)
    confirmed = [r for r in records if isinstance(r, ConfirmedRecord) and r.outcome == "confirmed"]
    missing = [r for r in confirmed if not (directory / file_name(r.requirement)).exists()]
    if not missing:
        return
    described = Manifest.model_validate(read_manifest(directory))
    evaluations = recorded_evaluations(directory, records)
    for record in missing:
        save(_stored(described, record, evaluations[record.index]), directory / file_name(record.requirement))


def _stored(described: Manifest, confirmed: ConfirmedRecord, evaluation: Evaluation) -> StoredCounterexample:
    """Counterexample of one requirement; where several shared a search, it is simulated again."""
    requirement, problem = described.requirement, described.request.problem
    if confirmed.requirement:
        requirement = described.of(confirmed.requirement).requirement
        target = f"{described.source.rpartition(':')[0]}:{confirmed.requirement}"
        problem = problem.model_copy(update={"target": target})
        loaded = problem.load()
        evaluation = evaluate(loaded, evaluation.candidate)
        loaded.model.close()
    verdict = evaluation.verdict
    if verdict is None:
        raise SimulationError(
            f"{requirement['name']}: the simulation {evaluation.status}: {evaluation.reason}"
        )
    digests = [digest for name, digest in described.hashes.items() if name.endswith(".fmu")]
    return StoredCounterexample(
        requirement=requirement["name"],
        formula=requirement["formula"],
        problem=problem,
        candidate=evaluation.candidate.to_json(),
        robustness=verdict.robustness,
        critical_time=verdict.critical_time,
        predicate=verdict.predicate,
        outcome="confirmed",
        reason=confirmed.reason,
        fmu_sha256=digests[0] if digests else None,
    )


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
    return stored.problem.load()


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
        spec, _, _ = problem.source.rpartition(":")
        return self.folder / (f"{Path(spec).stem}.{problem.name}" if spec else problem.name)


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


def _seen_from(request: ProblemRequest, folder: Path) -> ProblemRequest:
    """Return the request with its file as seen from a folder."""
    file, requirement = _split(request.target)
    if file is None:
        return request
    seen = Path(relpath(file.resolve(), folder.resolve())).as_posix()
    return request.model_copy(update={"target": f"{seen}{requirement}"})


def _found_from(request: ProblemRequest, folder: Path) -> ProblemRequest:
    """Return the request with its file, which is given as seen from a folder, as found from here."""
    file, requirement = _split(request.target)
    return request if file is None else request.model_copy(update={"target": f"{folder / file}{requirement}"})
