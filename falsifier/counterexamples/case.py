"""What is known of a run or file: a counterexample, the nearest miss, or inputs to start a search from."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from falsifier.core.candidate import Candidate
from falsifier.core.literals import shell_word
from falsifier.core.words import counted
from falsifier.counterexamples import store
from falsifier.counterexamples.store import StoredCounterexample
from falsifier.errors import CandidateError, SimulationError, SpecError, written
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.evaluation.input_file import read_inputs
from falsifier.fmu import FmuModel, System
from falsifier.problem.loading import load_source
from falsifier.problem.problem import Problem
from falsifier.problem.shorthand import given_rights
from falsifier.problem.source import ProblemSource
from falsifier.record import manifest
from falsifier.record.journal import holds_run, read_journal, recorded_evaluations, simulated
from falsifier.record.manifest import Manifest, Origin
from falsifier.stl.margins import margin_words, signed


@dataclass(frozen=True, slots=True)
class Case:
    """A counterexample, or the simulation of a run with the smallest robustness that is no violation."""

    file: Path  # the counterexample's file; of a nearest miss, that which its run would have
    candidate: Candidate  # what was simulated
    source: ProblemSource | None  # how to load the problem; None if it was made in Python
    allow: tuple[str, ...] | None  # what the FMU was allowed then; None if that is not recorded
    deny: tuple[str, ...]  # what it was denied then
    origin: Origin  # by what it was judged then
    # Content of the counterexample's file; None for a nearest miss.
    stored: StoredCounterexample | None = None
    # What a nearest miss is, in words, before anything is said about it; empty for a counterexample.
    text: str = ""

    @property
    def is_miss(self) -> bool:
        """Whether it is a nearest miss, no counterexample."""
        return self.stored is None

    @property
    def is_shrunk(self) -> bool:
        """Whether it is what a counterexample was shrunk to."""
        return not self.is_miss and self.file.stem.startswith("shrunk")

    @property
    def place(self) -> Path:
        """The counterexample's file; of a nearest miss, the run directory."""
        return self.file.parent if self.is_miss else self.file

    def problem(
        self, *, allow: Iterable[str] = (), deny: Iterable[str] = ()
    ) -> tuple[Problem, tuple[str, ...]]:
        """Load the problem; its FMU gets no more rights than it had then, and those that are given here.

        Whoever is handed a counterexample may not read what a spec has come to allow since. What is
        denied now adds to what was denied then. Paths that are given begin in the current folder.

        Returns:
            The problem, and the rights that the spec gives now but did not give then, which are withheld.

        Raises:
            SpecError: if it was made in Python, or cannot be loaded any more; JournalError: its file is gone.
        """
        if self.source is None:
            raise SpecError(
                f"{self.place}: the problem was made in Python: run the script or test that found this, or "
                "call simulate() and explain() there"
            )
        remedy = "put it there, or correct problem.target in this file and delete its last key, sum"
        manifest.check_in_sight(self.place, [self.source], remedy)
        manifest.check_named(self.place, [self.source])
        problem = load_source(self.source)
        model = problem.model
        if not isinstance(model, FmuModel | System):
            return problem, ()
        given = given_rights(allow, deny)
        kept = tuple(word for word in model.allow if self.allow is None or word in self.allow)
        withheld = tuple(word for word in model.allow if word not in (*kept, *given["allow"]))
        allowed = tuple(dict.fromkeys((*kept, *given["allow"])))
        denied = tuple(dict.fromkeys((*model.deny, *self.deny, *given["deny"])))
        return replace(problem, model=replace(model, allow=allowed, deny=denied)), withheld

    def changes(self, problem: Problem) -> list[str]:
        """Say what of the problem has changed since this was recorded."""
        return list(store.changes_since(self.origin, problem))

    def as_recorded(self, problem: Problem) -> Problem:
        """Return the problem with the formula that this was judged by: it is about no other one."""
        if str(problem.requirement.formula) == self.origin.formula:
            return problem
        return problem.with_requirement(self.origin.formula, problem.requirement.description)

    def admitted(self, problem: Problem) -> Candidate:
        """Return the candidate as the problem simulates it; CandidateError if the problem has changed."""
        try:
            return problem.space.admit(self.candidate)
        except CandidateError as error:
            raise CandidateError(
                f"{self.place}: does not fit what is searched now: {error}; undo what has changed in the "
                "spec or the FMU, or search again"
            ) from None

    def content(self, confirmation: Confirmation) -> StoredCounterexample:
        """Return what to store of a confirmation of this; SpecError if the violation is refuted."""
        if confirmation.outcome == "refuted":
            raise SpecError(f"{self.place}: {confirmation.reason}")
        return store.to_store(confirmation).model_copy(update={"problem": self.source})

    def simulated(self, problem: Problem) -> Evaluation:
        """Simulate it again, for its trajectory.

        Raises:
            SimulationError: if the simulation of a nearest miss fails.
            SpecError: if a counterexample no longer violates, or a nearest miss does now.
        """
        evaluation = evaluate(problem, self.admitted(problem))
        if self.is_miss and evaluation.robustness is None:
            raise SimulationError(f"{problem.name}: the simulation now fails: {evaluation.reason}")
        if self.is_miss and evaluation.violated:
            place, call = shell_word(self.place), "falsify(..., start_from=[...])"
            raise SpecError(
                f"the nearest miss of {problem.name} now violates (robustness "
                f"{signed(evaluation.robustness)}): the model or the requirement has changed; search again: "
                + written(f"falsifier run ... --inputs {place}", call)
            )
        if not self.is_miss and not evaluation.violated:
            found = evaluation.reason or f"its robustness is now {signed(evaluation.robustness)}"
            raise SpecError(
                f"the counterexample of {problem.name} no longer violates: {found}; search for another one"
            )
        return replace(evaluation, candidate=replace(evaluation.candidate, rationale=""))


def counterexample_case(place: Path) -> Case:
    """Return the counterexample of a run directory or file; SpecError if there is none or more than one."""
    file = store.counterexample_file(place)
    stored = store.load_counterexample(file)
    candidate = Candidate.from_json(stored.candidate)
    return Case(file, candidate, stored.problem, stored.allow, stored.deny, stored.origin, stored)


def case_of(place: Path, requirement: str | None = None, *, shrunk: bool = False) -> Case:
    """Return the counterexample of a run or file; of a run without one, its nearest miss.

    ``shrunk``: what a run's counterexample was shrunk to, if it was, of the same model.

    Raises:
        SpecError: if there is neither.
        JournalError: if a run searched several requirements and none is named.
    """
    if not (place.is_dir() and holds_run(place)):
        if requirement is not None:
            raise SpecError(f"{place}: not a run directory, of which a requirement can be chosen")
        return counterexample_case(place)
    store.keep_recorded(place)
    described = manifest.read(place)
    name = _chosen(place, described, requirement)
    file = place / store.file_of(name, shared=described.shared)
    if not file.exists():
        return nearest_miss(place, name)
    found, simpler = counterexample_case(file), store.beside(file, store.SHRUNK)
    other = counterexample_case(simpler) if shrunk and simpler.exists() else found
    return other if other.origin == found.origin else found


def nearest_miss(directory: Path, name: str) -> Case:
    """Return the simulation of a run that came nearest to violating the requirement of this name.

    Raises:
        SpecError: if no simulation was judged, or none has a robustness that is not negative.
    """
    described = manifest.read(directory)
    judged = _judged(directory, name)
    misses = [(robustness, candidate) for robustness, candidate in judged if robustness >= 0]
    if not judged:
        place = shell_word(directory)
        why = f"no simulation of this run could be judged by {name}; falsifier coverage {place} says why"
        empty = f"its journal contains no simulation; to simulate: falsifier resume {place}"
        raise SpecError(f"{directory}: {why if simulated(directory) else empty}")
    if not misses:
        why = f"each simulation that was judged violates {name}, but no violation was confirmed"
        raise SpecError(f"{directory}: no nearest miss: {why}")
    robustness, candidate = min(misses, key=lambda pair: pair[0])
    manifest.check_in_sight(directory, described.request.problems)
    return Case(
        directory / store.file_of(name, shared=described.shared),
        candidate,
        described.of(name).request.source,
        described.allow,
        described.deny,
        described.of(name).origin,
        text=f"{name} was not falsified in {counted(len(judged), 'simulation')}; this is about the nearest "
        f"miss, with robustness {signed(robustness)} ({margin_words(robustness)}).",
    )


def _chosen(place: Path, described: Manifest, requirement: str | None) -> str:
    """Return the requirement that was named, the only one, or the only one with a counterexample."""
    found = [name for name in described.names if (place / store.file_of(name, shared=True)).exists()]
    is_clear = requirement is None and len(found) == 1
    return found[0] if is_clear else described.of(requirement).requirement.name


def read_known(place: Path, problem: Problem) -> tuple[Candidate, list[str]]:
    """Read known inputs as they are, with notes on what of a file is not used, or kept after its end.

    The place is a CSV file of inputs, a counterexample file, or a run directory, of which the candidate with
    the smallest robustness is taken. A run is judged by the problem's requirement if it searched that,
    otherwise by its first one.

    Raises:
        SpecError: if the place is none of these, or every simulation of the run failed.
    """
    if place.suffix.lower() == ".csv" and not place.is_dir():
        table = read_inputs(place, problem.info)
        return Candidate(table.signals), table.notes(problem.experiment.stop_time)
    if not holds_run(place):
        if not place.is_dir() and place.suffix.lower() != ".json":
            found = "" if place.exists() else "no such file; "
            expected = "a CSV file of inputs (u.csv), a counterexample.json or a run directory"
            raise SpecError(f"{place}: {found}expected {expected}")
        return Candidate.from_json(store.load_counterexample(place).candidate), []
    names = manifest.read(place).names
    judged = _judged(place, problem.name if problem.name in names else names[0])
    if not judged:
        raise SpecError(f"{place}: no simulation of this run has a verdict; choose another run")
    return min(judged, key=lambda pair: pair[0])[1], []


def _judged(directory: Path, requirement: str) -> list[tuple[float, Candidate]]:
    """Return the robustness and the candidate of each recorded simulation with a verdict, in order."""
    evaluations = recorded_evaluations(read_journal(directory), requirement)
    return [(e.robustness, e.candidate) for e in evaluations.values() if e.robustness is not None]
