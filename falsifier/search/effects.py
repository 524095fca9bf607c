"""Which inputs and parameters a run shows to have no effect on what the requirement is about."""

from collections.abc import Iterator

from falsifier.core.candidate import Candidate
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import counted, listed
from falsifier.problem.problem import Problem
from falsifier.search.findings import Finding


class Effects:
    """Compares simulations that differ in one input or parameter alone.

    Others say nothing for certain: what one input changes, another may change back.

    Args:
        problem: what is searched.
    """

    def __init__(self, problem: Problem) -> None:
        self._names = problem.space.names
        # An input that the formula names has an effect on it, whatever the system does.
        self._signals = [s for s in problem.requirement.formula.signals if s not in self._names]
        self._judged = [name for name in self._names if name not in problem.requirement.formula.signals]
        # By name and the hash of everything else: what was simulated, and what came of it.
        self._seen: dict[tuple[str, int], tuple[set[int], set[int]]] = {}

    def see(self, candidate: Candidate, trajectory: Trajectory) -> None:
        """Add a simulation."""
        varied = {**candidate.signals, **candidate.parameters}
        parts = {name: hash(varied[name]) for name in self._names}
        outcome = hash(tuple(trajectory[name].tobytes() for name in self._signals))
        for name in self._judged:
            rest = hash(tuple((other, part) for other, part in parts.items() if other != name))
            values, outcomes = self._seen.setdefault((name, rest), (set(), set()))
            values.add(parts[name])
            outcomes.add(outcome)

    def findings(self) -> Iterator[Finding]:
        """Yield what never had an effect although simulations differ in it alone."""
        if not self._signals:
            return
        for name in self._judged:
            alone = [seen for (of, _), seen in self._seen.items() if of == name and len(seen[0]) > 1]
            if alone and all(len(outcomes) == 1 for _, outcomes in alone):
                count = sum(len(values) for values, _ in alone)
                yield Finding(
                    kind="effect",
                    text=(
                        f"{name} had no effect on {listed(self._signals)}: the same in "
                        f"{counted(count, 'simulation')} that differ in it alone."
                    ),
                    part=name,
                )
