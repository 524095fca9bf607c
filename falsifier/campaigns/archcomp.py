"""ARCH-COMP: its requirements, and counterexamples as rows of a CSV file, and their re-simulation.

Columns and rules are those of the ARCH-COMP falsification category, as written by its participants' exporters
and read by FalStar's validator (``Validation.scala``): ``input`` is the matrix ``[t0 u1 u2; t1 u1 u2; ...]``,
``parameters`` the vector ``[p1 p2 ...]``. An input sampled once per second or less often is piecewise
constant; a denser one is interpolated linearly. A counterexample that is not reproduced is still accepted if
its robustness is below the requirement's tolerance.
"""

import csv
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from falsifier.campaigns.runs import Run
from falsifier.campaigns.tables import read_published
from falsifier.core.candidate import Candidate
from falsifier.core.literals import csv_text
from falsifier.core.signals import Signal
from falsifier.core.words import counted, shortened
from falsifier.errors import FalsifierError, SpecError, did_you_mean, first_fault
from falsifier.evaluation.evaluate import evaluate_any
from falsifier.evaluation.input_file import csv_rows
from falsifier.problem.loading import find_spec, load_problem
from falsifier.problem.problem import Problem
from falsifier.problem.source import Parameterization, ProblemSource
from falsifier.problem.spec import read_spec
from falsifier.record.journal import candidates_in

Matrix = NDArray[np.float64]

SUITES = ("arch-comp",)
# The competition's protocol: simulations per run, and the parameterization that published results have.
PROTOCOL_SIMULATIONS = 1500
PROTOCOL_PARAMETERIZATION: Parameterization = "fixed"
# Columns without which a file claims nothing.
_READ = ("property", "input", "falsified", "simulations")
_PROFILES = {"1": None, "2": "instance2"}
# The competition's names of our requirements: (system, property).
_NAMES = {
    "NN": ("NN", "(NN 0.005 0.03)"),
    "NNb": ("NN", "(NN 0.005 0.04)"),
    "NNx": ("NN", "NNx"),
    "F16": ("F16", "F16a"),
    "SC": ("SC", "SCa"),
    "AFC27": ("AFC_normal", "(AFC27 0.008)"),
}
# A counterexample is accepted if its re-simulated robustness is below this value.
_TOLERANCES = (
    (r"AT1", 1.2),
    (r"AT2", 10.0),
    (r"AT6.*", 1.0),
    (r"NN.*", 0.1),
    (r"CC.*", 1.0),
    (r"SC", 0.05),
    (r"AFC27", 8e-4),
    (r"AFC29|AFC33", 7e-4),
)
# An input with at least this step in s is piecewise constant; all others are exported with the dense step.
_COARSE = 1.0
_DENSE_STEP = 0.05
_LONGEST_SHOWN = 60
# Share of a range by which a value may lie outside it because of rounding when it was printed.
_ROUNDING = 1e-6


def suite(name: str, *, profile: str | None = None) -> tuple[ProblemSource, ...]:
    """Requirements of a suite, with the parameterization that published results have.

    Args:
        name: ``arch-comp``: the requirements in ``published.toml``, in that order.
        profile: profile of the specs; requirements whose spec does not offer it are omitted.

    Raises:
        SpecError: for an unknown name.
    """
    if name not in SUITES:
        raise SpecError(f"unknown suite {name!r}; {did_you_mean(name, SUITES)}")
    targets = [_bundled_target(requirement) for requirement in read_published().columns["best"]]
    return tuple(
        ProblemSource(target=target, profile=profile, parameterization=PROTOCOL_PARAMETERIZATION)
        for target in targets
        if profile is None or profile in read_spec(find_spec(target)[0]).profiles
    )


def _bundled_target(requirement: str) -> str:
    """Target of a bundled requirement with its spec, such as ``NN:NN``: ``NN`` alone is the whole spec."""
    return f"{find_spec(requirement)[0].stem}:{requirement}"


def _our_name(property_: str) -> str:
    known = {theirs.replace(" ", ""): ours for ours, (_, theirs) in _NAMES.items()}
    return known.get(property_.replace(" ", ""), property_)


def _matrix(text: str) -> Matrix:
    """Parse a matrix in MATLAB notation; empty text is an empty matrix."""
    rows = [re.split(r"[\s,]+", row.strip()) for row in text.strip("[] \t\n").split(";") if row.strip()]
    try:
        return np.atleast_2d(np.array([[float(v) for v in row] for row in rows], dtype=np.float64))
    except ValueError:  # no number, or rows of unequal length
        shown = repr(shortened(text, _LONGEST_SHOWN))
        raise ValueError(f"expected numbers such as [0 50; 10 20], got {shown}") from None


class Row(BaseModel):
    """One row of a validation file, which describes one run."""

    model_config = ConfigDict(arbitrary_types_allowed=True, frozen=True)

    number: int  # number of the row, from 1
    # Our name of the property.
    requirement: Annotated[str, BeforeValidator(_our_name)] = Field(alias="property")
    instance: Literal["1", "2"] = "1"
    # Times in s in the first column, then one column per input, shape (n, 1 + inputs).
    input: Annotated[Matrix, BeforeValidator(_matrix)] = np.empty((1, 0))
    # Parameter values in the order of the problem, shape (1, parameters).
    parameters: Annotated[Matrix, BeforeValidator(_matrix)] = np.empty((1, 0))
    falsified: bool = False  # whether the tool claims a counterexample
    simulations: int = Field(ge=0)  # number of simulations used
    # Robustness that the tool claims, if it is stated and finite.
    robustness: Annotated[float | None, AfterValidator(lambda r: r if r is None or isfinite(r) else None)] = (
        None
    )
    stop_time: float | None = Field(None, alias="stop time")  # end of the simulation in s, if stated


@dataclass(frozen=True, slots=True)
class Revalidated:
    """Result of re-simulating one claimed counterexample: whether the claim is accepted, and why."""

    row: Row
    accepted: bool
    robustness: float | None  # None if there was no simulation
    reason: str


def export(runs: Iterable[Run]) -> dict[str, str]:
    """Runs in the validation format, by the label of their method: the format itself tells only instances.

    Raises:
        JournalError: if a run is damaged.
    """
    methods: dict[str, list[Run]] = {}
    for run in runs:
        is_instance = run.method.profile in _PROFILES.values()
        method = replace(run.method, profile="") if is_instance else run.method
        methods.setdefault(method.label, []).append(run)
    tables = {label: [_exported(run) for run in of_method] for label, of_method in methods.items()}
    return {label: csv_text([rows[0], *(row.values() for row in rows)]) for label, rows in tables.items()}


def read_rows(path: Path) -> list[Row]:
    """Read a validation file, but no other columns; SpecError naming a row that is invalid, and why."""
    csv.field_size_limit(10**9)  # a dense input is longer than the csv module's default allows
    (_, columns), *rows = csv_rows(path) or [(0, [])]
    if missing := [name for name in _READ if name not in columns]:
        raise SpecError(
            f"expected a CSV file in the ARCH-COMP validation format, as falsifier report DIR "
            f"--arch-comp FILE writes it; missing columns: {', '.join(missing)}",
            file=str(path),
        )
    found = (dict(zip(columns, cells, strict=False)) for _, cells in rows)
    return [_row(number, cells, path) for number, cells in enumerate(found, start=1)]


def validate(rows: Iterable[Row], *, budget: int = PROTOCOL_SIMULATIONS) -> list[Revalidated]:
    """Re-simulate all claimed counterexamples; a claim of more simulations than the budget is rejected."""
    return [_checked(row, budget) for row in rows if row.falsified]


def bundled_problem(requirement: str, instance: str, stop_time: float | None) -> Problem:
    """Load the bundled problem of a row; SpecError if there is none, or it ends before its requirement."""
    try:
        target = _bundled_target(requirement)
    except SpecError:  # its text lists all names, which would be repeated in each row
        raise SpecError(f"no bundled requirement {requirement!r}, and only these can be validated") from None
    return load_problem(target, profile=_PROFILES[instance], stop_time=stop_time)


def tolerance(requirement: str) -> float:
    """Upper limit of an accepted re-simulated robustness; 0 for AT5x, F16 and unknown requirements."""
    return next((value for name, value in _TOLERANCES if re.fullmatch(name, requirement)), 0.0)


def _exported(run: Run) -> dict[str, object]:
    """Return the row of a run, by the names of the columns in their order."""
    system, property_ = _NAMES.get(run.requirement, (run.manifest.model.rpartition(".")[2], run.requirement))
    row: dict[str, object] = {
        "system": system,
        "property": property_,
        "instance": next((i for i, p in _PROFILES.items() if p == (run.method.profile or None)), "1"),
        "input": "[]",
        "parameters": "[]",
        "falsified": "yes" if run.falsified else "no",
        "simulations": run.simulations,
        "simulation time": f"{run.spent.simulation_seconds:.6g}",
        "total time": f"{run.spent.seconds:.6g}",
        "robustness": "" if run.best_robustness is None else repr(run.best_robustness),
        "stop time": f"{run.manifest.stop_time:.10g}",
    }
    if run.counterexample is not None:
        candidate = candidates_in(run.directory)[run.counterexample]
        signals = {r.name: candidate.signals[r.name] for r in run.manifest.inputs}
        lines = (" ".join(f"{v:.12g}" for v in line) for line in _sampled(signals, run.manifest.stop_time))
        row["input"] = f"[{'; '.join(lines)}]"
        values = (candidate.parameters[p.name] for p in run.manifest.parameters)
        row["parameters"] = f"[{' '.join(repr(v) for v in values)}]"
    return row


def _sampled(signals: Mapping[str, Signal], stop_time: float) -> Matrix:
    """Control points if all signals are piecewise constant with long pieces, otherwise dense samples."""
    if not signals:
        return np.empty((0, 1))
    times = np.unique([t for signal in signals.values() for t in signal.times])
    coarse = all(s.interpolation == "constant" and s.hold is None for s in signals.values())
    if not coarse or (len(times) > 1 and np.diff(times).min() < _COARSE):
        step = min([_DENSE_STEP, *(s.hold for s in signals.values() if s.hold is not None)])
        times = np.linspace(0.0, stop_time, round(stop_time / step) + 1)
    return np.column_stack([times, *(signal.sample(times) for signal in signals.values())])


def _row(number: int, cells: Mapping[str, str], path: Path) -> Row:
    stated = {name: text.strip() for name, text in cells.items() if text.strip()}
    try:
        return Row.model_validate(stated | {"number": number})
    except ValidationError as error:
        column, told = first_fault(error)
        raise SpecError(f"row {number}: column {column}: {told}", file=str(path)) from None


def _checked(row: Row, budget: int) -> Revalidated:
    def result(reason: str, robustness: float | None = None, *, accepted: bool = False) -> Revalidated:
        return Revalidated(row, accepted, robustness, reason)

    if row.simulations > budget:
        return result(f"used {row.simulations} simulations, more than the limit of {budget}")
    try:
        problem = bundled_problem(row.requirement, row.instance, row.stop_time)
        candidate = _candidate(row, problem)
    except (FalsifierError, ValueError) as error:
        return result(str(error))
    evaluation = evaluate_any(problem, candidate)
    robustness, allowed = evaluation.robustness, tolerance(row.requirement)
    if robustness is None:
        return result(f"simulation failed: {evaluation.reason}")
    if robustness < 0:
        return result("reproduced", robustness, accepted=True)
    if robustness < allowed:
        return result(f"accepted, within the tolerance of {allowed:g}", robustness, accepted=True)
    return result("not reproduced", robustness)


def _candidate(row: Row, problem: Problem) -> Candidate:
    """Make the candidate of a row; ValueError if it does not fit the problem."""
    inputs, parameters = problem.space.inputs, problem.space.parameters
    columns, stated = max(row.input.shape[1] - 1, 0), row.parameters.ravel().tolist()
    if columns != len(inputs) or len(stated) != len(parameters):
        raise ValueError(
            f"contains {counted(columns, 'input')} and {counted(len(stated), 'parameter')}, expected "
            f"{len(inputs)} and {len(parameters)}"
        )
    signals = {}
    for i, r in enumerate(inputs, start=1):
        _check_range(f"input {r.name!r}", row.input[:, i], r.low, r.high)
        signals[r.name] = _signal(row.input[:, 0], row.input[:, i], r.hold)
    values = {p.name: value for p, value in zip(parameters, stated, strict=True)}
    for p in parameters:
        _check_range(f"parameter {p.name!r}", np.array([values[p.name]]), p.low, p.high)
    return Candidate(signals, values, origin="validation")


def _signal(times: Matrix, values: Matrix, hold: float | None) -> Signal:
    coarse = len(times) == 1 or float(np.diff(times).min()) >= _COARSE
    points = tuple(times.tolist()), tuple(values.tolist())
    return Signal(*points, "constant") if coarse else Signal(*points, "linear", hold)


def _check_range(what: str, values: Matrix, low: float, high: float) -> None:
    margin = _ROUNDING * (high - low)
    outside = (values < low - margin) | (values > high + margin)
    if outside.any():
        raise ValueError(f"{what}: {values[outside][0]:.12g} is outside its range [{low:.12g}, {high:.12g}]")
