"""One requirement as a test: what was found before is run first, then a bounded search looks for more."""

from dataclasses import dataclass
from pathlib import Path

from falsifier.counterexamples.shrink import shrink
from falsifier.counterexamples.store import Database, Replayed, replay, to_store
from falsifier.errors import SimulationError
from falsifier.evaluation.confirm import Confirmation, confirm
from falsifier.problem.problem import Problem
from falsifier.search.budget import Budget
from falsifier.search.result import Result
from falsifier.search.run import falsify


@dataclass(frozen=True, slots=True)
class Checked:
    """What became of a requirement.

    Attributes:
        problem: what was checked.
        counterexample: a confirmed violation, or None.
        file: where it is stored, or None.
        replayed: what became of the stored counterexamples, up to the first that violates.
        result: of the search; None where a stored counterexample violates.
    """

    problem: Problem
    counterexample: Confirmation | None
    file: Path | None
    replayed: tuple[Replayed, ...]
    result: Result | None


def check(
    problem: Problem,
    *,
    engine: str | None = None,
    budget: Budget | int = 100,
    seed: int = 0,
    database: Database | None = None,
) -> Checked:
    """Run the stored counterexamples, then search; a new counterexample is shrunk and stored.

    Args:
        problem: what to check.
        engine: name of an engine that needs no language model; None: the default one.
        budget: of the search; shrinking may use as many simulations again.
        seed: of the engine.
        database: where counterexamples are stored; None: nowhere.

    Raises:
        SimulationError: when a stored counterexample cannot be simulated, or nothing of the search can.
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
    """Shrunk counterexample, confirmed; the one that was found where that does not work out."""
    limit = budget.simulations if isinstance(budget, Budget) else budget
    shrunk = shrink(problem, found.evaluation, budget=limit or 2 * spent)
    again = confirm(problem, shrunk.evaluation)
    return again if again.outcome == "confirmed" else found
