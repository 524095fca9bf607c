"""What a run is asked about: its counterexample; without one, the simulation that came nearest."""

from dataclasses import dataclass, replace
from pathlib import Path

from falsifier.core.candidate import Candidate
from falsifier.core.files import file_name
from falsifier.counterexamples.known_inputs import judged_candidates
from falsifier.counterexamples.store import (
    StoredCounterexample,
    counterexample_file,
    file_of,
    keep_recorded,
    load,
    shrunk_file,
)
from falsifier.errors import SimulationError, SpecError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.loading import load_source
from falsifier.problem.problem import Problem
from falsifier.record import manifest
from falsifier.record.journal import holds_run
from falsifier.record.manifest import Manifest
from falsifier.stl.margins import signed


@dataclass(frozen=True, slots=True)
class NearestMiss:
    """The simulation of a run with the smallest robustness that is no violation.

    Attributes:
        directory: the run directory.
        described: the run's manifest, reduced to one requirement.
        shared: whether the run searched several requirements.
        candidate: what was simulated.
        robustness: its robustness, as recorded; not negative.
        simulations: number of simulations of the run that were judged.
    """

    directory: Path
    described: Manifest
    shared: bool
    candidate: Candidate
    robustness: float
    simulations: int

    @property
    def requirement(self) -> str:
        """Name of the requirement."""
        return self.described.requirement.name

    def beside(self, name: str) -> Path:
        """Return a path in the run directory, with the requirement in it if the run searched several."""
        place = Path(name)
        which = f"-{file_name(self.requirement)}" if self.shared else ""
        return self.directory / f"{place.stem}{which}{place.suffix}"

    def problem(self) -> Problem:
        """Load the problem.

        Raises:
            SpecError: if it was made in Python, or can no longer be loaded.
        """
        source = self.described.request.source
        if source is None:
            raise SpecError(
                f"{self.directory}: the problem of this run was made in Python: call simulate() and "
                "explain() there"
            )
        return load_source(source)

    def simulated(self, problem: Problem) -> Evaluation:
        """Simulate it again, for its trajectory.

        Raises:
            SimulationError: if the simulation fails.
            SpecError: if it violates now.
        """
        evaluation = evaluate(problem, problem.space.admit(self.candidate))
        if evaluation.robustness is None:
            raise SimulationError(f"{problem.name}: the simulation now fails: {evaluation.reason}")
        if evaluation.violated:
            raise SpecError(
                f"the nearest miss of {problem.name} now violates (robustness "
                f"{signed(evaluation.robustness)}): the model or the requirement has changed; search again: "
                f"falsifier run ... --start-from {self.directory}"
            )
        return replace(evaluation, candidate=replace(evaluation.candidate, rationale=""))


Subject = tuple[Path, StoredCounterexample] | NearestMiss


def asked_about(place: Path, requirement: str | None = None, *, shrunk: bool = False) -> Subject:
    """Return the counterexample of a run or file, with its file; of a run without one, its nearest miss.

    Args:
        place: run directory or counterexample file.
        requirement: which one, if a run searched several.
        shrunk: whether to return what a run's counterexample was shrunk to, if it was.

    Raises:
        SpecError: if there is neither, or a run searched several requirements and none is named.
    """
    if not (place.is_dir() and holds_run(place)):
        if requirement is not None:
            raise SpecError(f"{place}: --requirement chooses from a run directory; this is none")
        return counterexample_file(place), load(place)
    keep_recorded(place)
    described = manifest.read(place)
    name = _chosen(place, described, requirement)
    file = place / file_of(name if described.shared else "")
    if not file.exists():
        return nearest_miss(place, name)
    simpler = shrunk_file(file)
    file = simpler if shrunk and simpler.exists() else file
    return file, load(file)


def nearest_miss(directory: Path, requirement: str | None = None) -> NearestMiss:
    """Return the simulation of a run that came nearest to a violation; see NearestMiss.

    Args:
        directory: run directory.
        requirement: name of the requirement; None: the run's first.

    Raises:
        SpecError: if no simulation has a robustness that is not negative.
    """
    described = manifest.read(directory)
    name = described.names[0] if requirement is None else requirement
    judged = judged_candidates(directory, name)
    misses = [(robustness, candidate) for robustness, candidate in judged if robustness >= 0]
    if not misses:
        raise SpecError(f"{directory}: no simulation of this run nearly violates {name}; choose another run")
    robustness, candidate = min(misses, key=lambda pair: pair[0])
    return NearestMiss(directory, described.of(name), described.shared, candidate, robustness, len(judged))


def _chosen(place: Path, described: Manifest, requirement: str | None) -> str:
    """Return the requirement that was named, the only one, or the only one with a counterexample."""
    if requirement is not None:
        return described.of(requirement).requirement.name
    if not described.shared:
        return described.requirement.name
    found = [name for name in described.names if (place / file_of(name)).exists()]
    if len(found) == 1:
        return found[0]
    raise SpecError(
        f"this run searched {', '.join(described.names)}; choose one with --requirement NAME", file=str(place)
    )
