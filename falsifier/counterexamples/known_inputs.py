"""Known inputs to start a search from: measured, of a counterexample, or the best of an earlier run."""

from dataclasses import replace
from pathlib import Path

from falsifier.core.candidate import Candidate
from falsifier.core.fitting import Fitted, fit
from falsifier.counterexamples.store import load
from falsifier.engines.starting import KNOWN
from falsifier.errors import CandidateError, SpecError
from falsifier.evaluation.input_file import read_inputs
from falsifier.problem.problem import Problem
from falsifier.record import manifest
from falsifier.record.journal import holds_run, read_journal, recorded_evaluations


def known_inputs(place: Path, problem: Problem) -> Fitted:
    """Read known inputs, and fit them to a problem's search space.

    Args:
        place: a CSV file of inputs, a counterexample file, or a run directory, of which the evaluation with
            the smallest robustness is taken.
        problem: the problem that is to be searched.

    Raises:
        SpecError: if the place is none of these, or the run simulated nothing with success.
        CandidateError: naming the place and what does not fit the search space.
    """
    found = replace(_contained(place, problem), origin=KNOWN, rationale=f"from {place}")
    try:
        return fit(problem.space, found)
    except CandidateError as error:
        raise CandidateError(f"{place}: {error}") from None


def recorded_inputs(place: Path, requirement: str) -> Candidate:
    """Return a counterexample, or the candidate with the smallest robustness in a run.

    Args:
        place: counterexample file or run directory.
        requirement: the requirement that a run is judged by, if it searched that; otherwise the run's first.

    Raises:
        SpecError: if it is neither, or every simulation of the run failed.
    """
    if not holds_run(place):
        return Candidate.from_json(load(place).candidate)
    names = manifest.read(place).names
    judged = judged_candidates(place, requirement if requirement in names else names[0])
    if not judged:
        raise SpecError(f"{place}: no simulation of this run has a verdict; choose another run")
    return min(judged, key=lambda pair: pair[0])[1]


def judged_candidates(directory: Path, requirement: str) -> list[tuple[float, Candidate]]:
    """Return the robustness and the candidate of each recorded simulation with a verdict, in order."""
    evaluations = recorded_evaluations(directory, read_journal(directory), requirement).values()
    return [(e.robustness, e.candidate) for e in evaluations if e.robustness is not None]


def _contained(place: Path, problem: Problem) -> Candidate:
    if place.suffix.lower() == ".csv" and not place.is_dir():
        return Candidate(read_inputs(place, problem.info).signals)
    return recorded_inputs(place, problem.name)
