"""One requirement as a test: replays stored counterexamples first, then searches within a budget.

::

    counterexamples/specs/car.toml/fast/5f2c01ab.json      requirement fast of specs/car.toml
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from os.path import relpath
from pathlib import Path

from falsifier.core.candidate import Candidate
from falsifier.core.files import bundled, file_name
from falsifier.counterexamples import store
from falsifier.counterexamples.shrink import shrink
from falsifier.counterexamples.store import Replayed, StoredCounterexample
from falsifier.errors import FalsifierError, SimulationError, refusal
from falsifier.evaluation.confirm import Confirmation, confirm
from falsifier.problem.loading import source_file
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from falsifier.record.run import falsify
from falsifier.search import DEFAULT_SIMULATIONS
from falsifier.search.budget import Budget, Spent
from falsifier.search.result import Result


@dataclass(frozen=True, slots=True)
class Database:
    """A folder of counterexample files, one folder per requirement."""

    folder: Path  # the folder; it need not exist yet

    def save(self, problem: Problem, stored: StoredCounterexample) -> Path:
        """Write a counterexample; one with the same candidate is overwritten."""
        key = repr(Candidate.from_json(stored.candidate).key)
        place = self.place(problem.name, problem.source)
        return store.save(stored, place / f"{sha256(key.encode()).hexdigest()[:8]}.json")

    def fetch(self, problem: Problem) -> Iterator[tuple[Path, StoredCounterexample]]:
        """Yield the stored counterexamples of a problem, by file name."""
        for path in sorted(self.place(problem.name, problem.source).glob("*.json")):
            yield path, store.load_counterexample(path)

    def place(self, name: str, source: ProblemSource | None) -> Path:
        """Folder of a requirement: that of its spec or FMU mirrors the path from beside the database."""
        stated = None if source is None or source.parts.kind == "python" else source
        file = stated and (stated.parts.file or source_file(stated))
        parts = Path(relpath(Path(file).resolve(), self.folder.resolve().parent)).parts if file else ()
        if file and Path(file).resolve().parent == bundled("specs"):  # elsewhere on every machine
            parts = (Path(file).stem,)
        return self.folder.joinpath(*("_up" if part == ".." else part for part in parts), file_name(name))

    def spec_of(self, place: Path) -> Path:
        """Path of the spec to which a folder of requirements' folders belongs."""
        parts = place.relative_to(self.folder).parts
        return self.folder.resolve().parent.joinpath(*(".." if part == "_up" else part for part in parts))


@dataclass(frozen=True, slots=True)
class Checked:
    """Result of a check."""

    problem: Problem  # what was checked
    counterexample: Confirmation | None  # a confirmed violation, or None
    file: Path | None  # where it is stored, or None
    replayed: Mapping[Path, Replayed]  # stored ones by file, up to the first that still violates
    result: Result | None  # result of the search; None if a stored counterexample still violates
    not_stored: str = ""  # why it could not be stored


def check(
    problem: Problem,
    *,
    engine: str | None = None,
    budget: Budget | int = DEFAULT_SIMULATIONS,
    seed: int = 0,
    database: Database | None = None,
) -> Checked:
    """Replay the stored counterexamples, then search; a new counterexample is shrunk and stored.

    Args:
        problem: what to check.
        engine: name of an engine that does not use a language model; None: the default engine.
        budget: limits of the search; shrinking may use as many simulations (unlimited: twice those used).
        seed: seed of the engine.
        database: where counterexamples are stored; None: nowhere.

    Raises:
        SimulationError: if a stored counterexample cannot be simulated, or most of the search fail.
        KeyboardInterrupt: if the user stops the search, which then says nothing of the requirement.
    """
    replayed: dict[Path, Replayed] = {}
    for path, stored in database.fetch(problem) if database else ():
        replayed[path] = again = store.replay(stored, problem)
        if again.status == "violates":
            return Checked(problem, again.confirmation, path, replayed, None)
    result = falsify(problem, engine, budget=budget, seed=seed)
    if result.status == "failed":
        raise SimulationError(f"{problem.name}: {result.reason}")
    if result.status == "interrupted":
        raise KeyboardInterrupt
    found, refused, stop = result.counterexample, "", None
    try:
        found = found and _smallest(found, result.spent, budget)
    except KeyboardInterrupt as stopped:  # what was found is kept as it is
        stop = stopped
    try:
        file = database.save(problem, store.to_store(found)) if database and found else None
    except OSError as error:  # what was found is worth more than its file
        file, refused = None, refusal(error)
    if stop:
        raise stop
    return Checked(problem, found, file, replayed, result, refused)


def _smallest(found: Confirmation, spent: Spent, budget: Budget | int) -> Confirmation:
    """The shrunk counterexample if it is confirmed, otherwise the original."""
    limit = budget.simulations if isinstance(budget, Budget) else budget
    try:
        shrunk = shrink(found.problem, found.evaluation, budget=limit or 2 * spent.simulations)
    except FalsifierError:  # this time, its simulation fails
        return found
    again = confirm(found.problem, shrunk.evaluation)
    return again if again.outcome == "confirmed" else found
