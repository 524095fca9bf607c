"""Counterexamples as small, readable files that can be kept under version control and replayed at any time.

A file states how to load its problem (relative to the file itself), what was simulated and with what result,
so that it can be replayed after the FMU or the requirement has changed.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from os.path import relpath
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from falsifier import __version__
from falsifier.core.arguments import instance, path_of
from falsifier.core.candidate import Candidate
from falsifier.core.files import check_seal, file_name, seal, write_whole
from falsifier.core.literals import shell_word
from falsifier.core.strict import Strict
from falsifier.errors import (
    CandidateError,
    JournalError,
    SimulationError,
    SpecError,
    first_fault,
    in_section,
    written,
)
from falsifier.evaluation.confirm import Confirmation, Outcome, confirm
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.fmu import fmu_files, resolved, with_paths
from falsifier.problem.loading import reloadable, source_file
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from falsifier.record import manifest
from falsifier.record.journal import JOURNAL, holds_run, read_journal, recorded_evaluations
from falsifier.record.manifest import Origin
from falsifier.record.records import ConfirmedRecord
from falsifier.stl.margins import signed

FILE_NAME = "counterexample.json"
# What falsifier explain has found out, beside the counterexample's file; reports repeat it.
EXPLANATION = "explanation.txt"
# What falsifier explain --shrink makes of a counterexample, beside its file.
SHRUNK = "shrunk.json"

ReplayStatus = Literal["violates", "fragile", "does not violate", "does not fit"]

# Of a confirmation's outcome, None if nothing was violated: the status, and what is said of it.
_STATUS: dict[Outcome | None, tuple[ReplayStatus, str]] = {
    "confirmed": ("violates", "still violated"),
    "fragile": ("fragile", "fragile"),
    "refuted": ("does not violate", "violated, which is not confirmed any more"),
    None: ("does not violate", "no longer violated"),
}


class StoredCounterexample(Strict):
    """Content of a counterexample file."""

    format: Literal[1] = 1
    requirement: str
    formula: str
    problem: ProblemSource | None = Field(
        None, description="How to load the problem, paths relative to this file; null: made in Python."
    )
    candidate: dict[str, Any]
    robustness: float = Field(allow_inf_nan=False)
    critical_time: float
    predicate: str
    what_broke: str = Field("", description="What did not hold, and when, in words.")
    outcome: Outcome
    reason: str
    fmu_sha256: str | None = None
    spec_sha256: str | None = None
    allow: tuple[str, ...] | None = Field(
        None, description="What the FMU was allowed, paths relative to this file; null: as the spec says."
    )
    deny: tuple[str, ...] = Field((), description="What it was denied.")
    falsifier: str = __version__
    sum: str = Field(
        "", description="Checksum of the file up to the comma before it; without it, nothing is checked."
    )

    @property
    def origin(self) -> Origin:
        """What it belongs to."""
        return Origin(self.formula, self.fmu_sha256, self.spec_sha256)


@dataclass(frozen=True, slots=True)
class Replayed:
    """Result of replaying a stored counterexample.

    Attributes:
        status: ``violates`` (confirmed), ``fragile`` (only at the given communication step),
            ``does not violate``, or ``does not fit``: the problem has other inputs, ranges or control points.
        confirmation: confirmation of the new simulation, also a refuted one; None if that does not violate.
        evaluation: the new simulation; None if the counterexample does not fit.
        text: the result in words, including what has changed since the counterexample was stored.
    """

    status: ReplayStatus
    confirmation: Confirmation | None
    evaluation: Evaluation | None
    text: str


def to_store(confirmation: Confirmation) -> StoredCounterexample:
    """Make the content of the file for a confirmed or fragile violation."""
    problem = confirmation.problem
    return _content(
        problem.name,
        reloadable(problem),
        confirmation.evaluation,
        outcome=confirmation.outcome,
        reason=confirmation.reason,
        **Origin.of(str(problem.requirement.formula), manifest.file_hashes(problem))._asdict(),
        allow=tuple(getattr(problem.model, "allow", ())),
        deny=tuple(getattr(problem.model, "deny", ())),
    )


def _content(
    requirement: str, source: ProblemSource | None, evaluation: Evaluation, **recorded: Any
) -> StoredCounterexample:
    verdict = evaluation.verdict
    assert verdict is not None, "a failed simulation is not a counterexample"
    return StoredCounterexample(
        requirement=requirement,
        problem=source,
        candidate=evaluation.candidate.to_json(),
        robustness=verdict.robustness,
        critical_time=verdict.critical_time,
        predicate=verdict.predicate,
        what_broke=verdict.breach.text if verdict.breach else "",
        **recorded,
    )


def save(stored: StoredCounterexample, path: Path) -> Path:
    """Write a counterexample file atomically, with the problem's paths relative to it; return its path."""

    def seen(other: str) -> str:
        return Path(relpath(other, path.parent.resolve())).as_posix()

    source = stored.problem and _moved(stored.problem, lambda file: seen(str(Path(file).resolve())))
    allow = stored.allow and with_paths(stored.allow, lambda place: seen(str(place)))
    content = stored.model_copy(update={"problem": source, "allow": allow}).model_dump(mode="json")
    del content["sum"]
    return write_whole(path, seal(json.dumps(content, indent=2)))


def load_counterexample(path: Path | str) -> StoredCounterexample:
    """Read a counterexample file, or the counterexample in a run directory.

    Raises:
        SpecError: naming the file and what is wrong with it.
    """
    file = counterexample_file(path_of("path", path, "the path of a counterexample, or of a run"))
    is_ours = file.name.startswith(("counterexample", "shrunk")) and holds_run(file.parent)
    remedy = f"; to write it again: falsifier tools repair {shell_word(file.parent)}" if is_ours else ""
    try:
        content = file.read_bytes()
        stored = StoredCounterexample.model_validate_json(content)
    except OSError as error:
        raise SpecError(f"cannot be read: {error.strerror}", file=str(file)) from None
    except ValidationError as error:
        key, why = first_fault(error)
        if error.errors()[0]["type"] in ("json_invalid", "missing") or not key:
            expected = "expected the counterexample.json of a run, or a run directory"
            key, why = "", f"damaged{remedy}" if remedy else expected
        raise SpecError(f"not a counterexample file: {why}", file=str(file), key=key) from None
    try:
        if stored.sum:
            check_seal(content)
    except ValueError as error:
        raise SpecError(
            f"damaged or edited: {error}; if it was edited on purpose, delete its key sum{remedy}",
            file=str(file),
        ) from None
    with in_section(str(file), "candidate"):
        Candidate.from_json(stored.candidate)
    found = stored.problem and _moved(stored.problem, lambda relative: str(file.parent / relative))
    allow = stored.allow and resolved(stored.allow, file.parent)
    return stored.model_copy(update={"problem": found, "allow": allow, "sum": ""})


def counterexample_file(path: Path) -> Path:
    """Find a counterexample by its path or run directory; SpecError unless there is exactly one."""
    if not path.is_file():
        keep_recorded(path if path.is_dir() else path.parent)  # it may be in the journal only
    if path.is_file():
        return path
    if not path.is_dir():
        raise SpecError(
            "no such file or directory; expected a run directory or a counterexample file", file=str(path)
        )
    found = sorted(path.glob("counterexample*.json"))
    if len(found) == 1:
        return found[0]
    if found:
        names = ", ".join(map(str, found))
        raise SpecError(
            f"this run has several counterexamples; choose one of these files: {names}", file=str(path)
        )
    expected = "expected a counterexample file or the directory of a run that found one"
    if not holds_run(path):
        manifest.check_no_folder(path)
        raise SpecError(f"not a run directory; {expected}", file=str(path))
    also = written(". falsifier explain also takes a run that found none", "")
    raise SpecError(f"contains no confirmed counterexample; {expected}{also}", file=str(path))


def file_of(requirement: str, *, shared: bool) -> str:
    """Name of a counterexample's file in a run directory; shared: several requirements share the search.

    >>> file_of("AT1", shared=False), file_of("AT1", shared=True)
    ('counterexample.json', 'counterexample-AT1.json')
    """
    return f"counterexample-{file_name(requirement)}.json" if shared else FILE_NAME


def beside(counterexample: Path, name: str) -> Path:
    """Path next to a counterexample's file, with its suffix if the directory contains several.

    >>> beside(Path("run/counterexample-AT1.json"), SHRUNK).name
    'shrunk-AT1.json'
    """
    place, (kind, dash, requirement) = Path(name), counterexample.stem.partition("-")
    which = f"{dash}{requirement}" if kind in ("counterexample", "shrunk") else ""
    if kind == "fragile":  # a run may have several, and a counterexample beside them
        which = f"-{counterexample.stem}"
    return counterexample.with_name(f"{place.stem}{which}{place.suffix}")


def keep_recorded(directory: Path, *, begun_here: bool = False) -> None:
    """Write the files of counterexamples that are only in a run directory's journal.

    Runs that were killed, and runs of a campaign, leave only a journal. Without a run, nothing is done.
    ``begun_here``: the current folder is the one in which the run began, to which its paths are relative.

    Raises:
        JournalError: if what was confirmed is not recorded as a violation, or paths lead nowhere from here.
    """
    if not holds_run(directory):
        return
    described, records = manifest.read(directory), read_journal(directory)
    for record in records:
        if not isinstance(record, ConfirmedRecord) or record.outcome != "confirmed":
            continue
        file = directory / file_of(record.requirement, shared=described.shared)
        if file.exists():
            continue
        alone = described.of(record.requirement)
        if not begun_here:
            manifest.check_in_sight(directory, alone.request.problems)
        evaluation = recorded_evaluations(records, record.requirement).get(record.index)
        if evaluation is None or not evaluation.violated:
            raise JournalError(
                f"{directory / JOURNAL}: line {record.line} confirms a counterexample of "
                f"{record.requirement}, but simulation {record.index + 1} is not recorded as a violation: no "
                "run writes this; start a new one"
            )
        content = _content(
            record.requirement,
            alone.request.source,
            evaluation,
            outcome="confirmed",
            reason=record.reason,
            **alone.origin._asdict(),
            allow=described.allow,
            deny=described.deny,
        )
        save(content, file)


def replay(stored: StoredCounterexample, problem: Problem) -> Replayed:
    """Simulate a stored counterexample again, and confirm it if it violates.

    Raises:
        SimulationError: if the simulation fails.
    """
    instance("stored", stored, StoredCounterexample, "a counterexample as load_counterexample returns it")
    changes = "".join(f"; {change}" for change in changes_since(stored.origin, problem))
    try:
        candidate = problem.space.admit(Candidate.from_json(stored.candidate))
    except CandidateError as error:
        text = f"{problem.name}: the counterexample does not fit the problem: {error}{changes}"
        return Replayed("does not fit", None, None, text)
    evaluation = evaluate(problem, candidate)
    if evaluation.robustness is None:
        raise SimulationError(f"{problem.name}: the simulation {evaluation.outcome}")
    confirmation = confirm(problem, evaluation) if evaluation.violated else None
    status, said = _STATUS[confirmation.outcome if confirmation else None]
    breach = evaluation.verdict.breach if evaluation.verdict else None
    broke = f": {breach.text};" if breach else ","
    text = (
        f"{problem.name}: {said}{broke} robustness {signed(evaluation.robustness)} "
        f"(recorded {signed(stored.robustness)})"
    )
    text += f"; {confirmation.reason}" if confirmation else ""
    return Replayed(status, confirmation, evaluation, text + changes)


def changes_since(then: Origin, problem: Problem) -> Iterator[str]:
    """Say what of a problem is no longer as it was when something was recorded."""
    now = Origin.of(str(problem.requirement.formula), manifest.file_hashes(problem))
    if then.fmu_sha256 is not None and now.fmu_sha256 != then.fmu_sha256:
        several = len(fmu_files(problem.model)) > 1
        yield f"{'an FMU of the system' if several else 'the FMU'} has changed since it was stored"
    if then.spec_sha256 is not None and now.spec_sha256 != then.spec_sha256:
        spec = problem.source and source_file(problem.source)
        yield f"{spec.name if spec else 'the spec'} has changed since it was stored"
    if now.formula != then.formula:
        yield f"the requirement has changed from {then.formula} to {now.formula}"


def _moved(source: ProblemSource, move: Callable[[str], str]) -> ProblemSource:
    """Return the source with another path of its file; one with a bundled name stays."""
    parts = source.parts
    if not parts.file:
        return source
    requirement = f":{parts.requirement}" if parts.requirement else ""
    return source.model_copy(update={"target": f"{move(parts.file)}{requirement}"})
