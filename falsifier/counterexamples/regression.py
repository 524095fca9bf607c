"""One requirement as a test: replays stored counterexamples first, then searches within a budget.

::

    counterexamples/AT.AT1/5f2c01ab.json      requirement AT1 of AT.toml
"""

from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from falsifier.core.candidate import Candidate
from falsifier.core.files import file_name
from falsifier.counterexamples.shrink import shrink
from falsifier.counterexamples.store import (
    Replayed,
    StoredCounterexample,
    load_counterexample,
    replay,
    save,
    to_store,
)
from falsifier.errors import SimulationError
from falsifier.evaluation.confirm import Confirmation, confirm
from falsifier.problem.loading import spec_file
from falsifier.problem.problem import Problem
from falsifier.record.run import falsify
from falsifier.search import DEFAULT_SIMULATIONS
from falsifier.search.budget import Budget
from falsifier.search.result import Result


@dataclass(frozen=True, slots=True)
class Database:
    """A folder of counterexample files, one folder per requirement."""

    folder: Path  # the folder; it need not exist yet

    def save(self, problem: Problem, stored: StoredCounterexample) -> Path:
        """Write a counterexample; one with the same candidate is overwritten."""
        key = repr(Candidate.from_json(stored.candidate).key)
        return save(stored, self._place(problem) / f"{sha256(key.encode()).hexdigest()[:8]}.json")

    def fetch(self, problem: Problem) -> Iterator[tuple[Path, StoredCounterexample]]:
        """Yield the stored counterexamples of a problem, by file name."""
        for path in sorted(self._place(problem).glob("*.json")):
            yield path, load_counterexample(path)

    def _place(self, problem: Problem) -> Path:
        spec = None if problem.source is None else spec_file(problem.source)
        return self.folder / file_name(f"{spec.stem}.{problem.name}" if spec else problem.name)


@dataclass(frozen=True, slots=True)
class Checked:
    """Result of a check."""

    problem: Problem  # what was checked
    counterexample: Confirmation | None  # a confirmed violation, or None
    file: Path | None  # where it is stored, or None
    # Results of the stored counterexamples, up to the first that still violates.
    replayed: tuple[Replayed, ...]
    result: Result | None  # result of the search; None if a stored counterexample still violates


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
        budget: limits of the search; shrinking may use the same number of simulations again.
        seed: seed of the engine.
        database: where counterexamples are stored; None: nowhere.

    Raises:
        SimulationError: if a stored counterexample cannot be simulated, or every simulation of the search
            fails.
    """
    replayed: list[Replayed] = []
    for path, stored in database.fetch(problem) if database else ():
        again = replay(stored, problem)
        replayed.append(again)
        if again.status == "violates":
            return Checked(problem, again.confirmation, path, tuple(replayed), None)
    result = falsify(problem, engine, budget=budget, seed=seed)
    if result.status == "failed":
        raise SimulationError(f"{problem.name}: {result.reason}")
    found = result.counterexample and _smallest(
        problem, result.counterexample, result.spent.simulations, budget
    )
    file = database.save(problem, to_store(found)) if database and found else None
    return Checked(problem, found, file, tuple(replayed), result)


def _smallest(problem: Problem, found: Confirmation, spent: int, budget: Budget | int) -> Confirmation:
    """The shrunk counterexample if it is confirmed, otherwise the original."""
    limit = budget.simulations if isinstance(budget, Budget) else budget
    shrunk = shrink(problem, found.evaluation, budget=limit or 2 * spent)
    again = confirm(problem, shrunk.evaluation)
    return again if again.outcome == "confirmed" else found
