"""Evaluation of a candidate: simulate it and monitor the trajectory."""

import logging
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Any, Literal

import numpy as np

from falsifier.core.arguments import finite, instance
from falsifier.core.candidate import Candidate
from falsifier.core.experiment import GRID_ROUNDING
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.errors import (
    CandidateError,
    ModelError,
    MonitorError,
    OutputError,
    SimulationError,
    did_you_mean,
    shown,
)
from falsifier.evaluation.input_file import read_inputs
from falsifier.fmu import System
from falsifier.problem.problem import Problem, check_problem
from falsifier.problem.ranges import string_value
from falsifier.stl import Formula, Monitor
from falsifier.stl.monitor import Verdict

_LOG = logging.getLogger(__name__)
Status = Literal["ok", "failed", "crashed", "timeout"]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A candidate with its verdict, or the reason why there is none.

    Attributes:
        candidate: the simulated candidate.
        status: ``ok``, or how the simulation ended: ``failed``, ``crashed``, ``timeout``.
        verdict: robustness and what decided it; None unless the status is ok.
        reason: why there is no verdict; empty if there is one.
        trajectory: outputs, then inputs, on the output grid; None unless the status is ok.
        seconds: wall-clock time of the simulation in s.
        log: messages of the model.
    """

    candidate: Candidate
    status: Status = "ok"
    verdict: Verdict | None = None
    reason: str = ""
    trajectory: Trajectory | None = None
    seconds: float = 0.0
    log: tuple[str, ...] = ()

    @property
    def robustness(self) -> float | None:
        """Robustness; None if there is no verdict."""
        return None if self.verdict is None else self.verdict.robustness

    @property
    def violated(self) -> bool:
        """Whether the requirement is violated; False for a failed simulation."""
        return self.verdict is not None and self.verdict.violated

    @property
    def outcome(self) -> str:
        """How a simulation that failed ended, and why."""
        return f"{'timed out' if self.status == 'timeout' else self.status}: {self.reason}"


def evaluate(problem: Problem, candidate: Candidate) -> Evaluation:
    """Simulate one candidate and monitor its trajectory.

    A simulation that fails, crashes or hangs is returned as an evaluation with a status and a reason.

    Raises:
        CandidateError: if something that is searched has no value, or one outside its range, or one that the
            variable's type does not have.
        ModelError: if the model cannot be used at all.
    """
    check_problem(problem)
    instance("candidate", candidate, Candidate, "a Candidate")
    problem.space.check(candidate)
    _check_types(problem.info, candidate.signals, candidate.parameters)
    return evaluate_any(problem, candidate)


def evaluate_any(problem: Problem, candidate: Candidate) -> Evaluation:
    """Evaluate a candidate that need not fit: a pure function, in whichever process it runs."""
    found = evaluate_for_all(problem, candidate)
    return judge(problem, found) if found.verdict is None else found


def evaluate_for_all(problem: Problem, candidate: Candidate) -> Evaluation:
    """Do the same; what cannot be judged keeps its trajectory: other requirements may be judged by it."""
    started = perf_counter()
    try:
        outputs = _outputs(problem, candidate)
    except SimulationError as error:
        seconds = perf_counter() - started
        return Evaluation(candidate, error.status, None, str(error), None, seconds, error.log)
    seconds = perf_counter() - started
    trajectory = _with_inputs(problem, candidate, outputs)
    simulated = Evaluation(candidate, trajectory=trajectory, seconds=seconds, log=outputs.log)
    judged = judge(problem, simulated)
    return simulated if judged.verdict is None else judged


def _outputs(problem: Problem, candidate: Candidate) -> Trajectory:
    """Simulate; again without internal variables if they may be why it failed: they must fail none."""
    experiment, given = problem.experiment, numbers(problem, candidate)
    try:
        return problem.model.simulate(candidate.signals, given, experiment)
    except OutputError:
        own = tuple(name for name in experiment.outputs if name not in experiment.internals)
        if own == experiment.outputs:
            raise
    return problem.model.simulate(candidate.signals, given, replace(experiment, outputs=own))


def simulate(
    problem: Problem,
    inputs: Mapping[str, Signal | float | str] | Candidate | str | PathLike[str] | None = None,
    parameters: Mapping[str, float | str] | None = None,
) -> Evaluation:
    """Simulate given inputs and evaluate the requirement; the ranges of the search space do not apply.

    Args:
        problem: the model to simulate and the requirement to evaluate.
        inputs: a signal, or for a constant one a number or the name of an enumeration's item, by input name;
            or a CSV file of inputs; or a candidate with its parameters. Other inputs keep the problem's fixed
            or the model's start values.
        parameters: values, names of items or texts of strings, by name; others stay as they are.

    Raises:
        CandidateError: if a name is not an input, or not a parameter or start value that can be set, or a
            value is one that the variable's type does not have: the FMU would get another one.
        SpecError: naming what is no number and no signal.
        ModelError: if the model cannot be used at all.

    >>> simulate(load_problem("AT1"), {"throttle": 100.0}).robustness  # doctest: +SKIP
    -0.213
    """
    check_problem(problem)
    info = problem.info
    driven: Any = {} if inputs is None else inputs
    values = {} if parameters is None else parameters
    if isinstance(driven, str | PathLike):
        found = read_inputs(Path(driven), info)
        for note in found.notes(problem.experiment.stop_time):
            _LOG.warning("%s: %s", driven, note)
        driven = found.signals
    if isinstance(driven, Candidate):
        driven, values = driven.signals, {**driven.parameters, **values}
    instance("inputs", driven, Mapping, "numbers or signals by name, a CSV file or a candidate")
    instance("parameters", values, Mapping, "numbers by name, such as {'p': 1.5}")
    known = [v.name for v in info.inputs]
    settable = [v.name for v in info.variables if v.settable and v.causality != "input"]
    settable += [v.name for v in info.parameters]
    for name in driven:
        if name not in known:
            raise CandidateError(f"the model has no input {name!r}; {did_you_mean(str(name), known)}")
    for name in values:
        if name not in settable:
            near = did_you_mean(str(name), [other for other in (*known, *settable) if other != name])
            raise CandidateError(f"the model has no parameter {name!r} to set; {near}")
    signals = {name: _signal(info[name], given) for name, given in driven.items()}
    fixed = {name: value for name, value in problem.parameters.items() if name not in signals}
    strings = {n: _text(f"parameters.{n}", v) for n, v in values.items() if info[n].kind == "string"}
    numbers = {n: _number(f"parameters.{n}", info[n], v) for n, v in values.items() if n not in strings}
    _check_types(info, signals, numbers)
    strings = dict(problem.experiment.strings) | strings
    experiment = replace(problem.experiment, strings=tuple(strings.items()))
    problem = replace(problem, parameters=fixed, experiment=experiment)
    return evaluate_any(problem, Candidate(signals, numbers, "user"))


def _check_types(info: ModelInfo, signals: Mapping[str, Signal], numbers: Mapping[str, float]) -> None:
    """Refuse values that a variable's type does not have: the FMU would get others."""
    given = {name: (signal.values, signal.interpolation) for name, signal in signals.items()}
    given |= {name: ((number,), "constant") for name, number in numbers.items()}
    for name, (values, interpolation) in given.items():
        if info.kind(name) == "real":
            continue
        variable = info[name]
        if variable.kind == "string":
            raise CandidateError(f"{name} is a string, and only numbers can be given here: leave it out")
        if interpolation != "constant" and len(values) > 1:
            raise CandidateError(
                f"{name}: values of type {variable.kind} cannot have {interpolation} interpolation; use "
                "'constant'"
            )
        for value in values:
            if expected := variable.expected(value):
                raise CandidateError(f"{name} = {value:.12g}: {expected}")


def _signal(variable: Variable, given: Signal | float | str) -> Signal:
    if isinstance(given, Signal):
        return given
    number = _number(f"inputs.{variable.name}", variable, given, " or a Signal(times, values)")
    return Signal((0.0,), (number,))


def _text(what: str, given: float | str) -> str:
    return string_value(given if isinstance(given, str) else finite(what, given, "a text"), Path())


def _number(what: str, variable: Variable, given: object, others: str = "") -> float:
    """Return a number, or that of a truth value or of an enumeration's item."""
    word = shown(given) if isinstance(given, bool) else given
    number = variable.number_of(word) if isinstance(word, str) else None
    return finite(what, given, f"a finite number{variable.or_name}{others}") if number is None else number


def check_evaluation(problem: Problem, evaluation: Evaluation) -> None:
    """Check that a user gave a problem and an evaluation; SpecError if not."""
    check_problem(problem)
    instance("evaluation", evaluation, Evaluation, "an Evaluation, such as confirmation.evaluation")


def start_values(problem: Problem) -> dict[str, tuple[float, float]]:
    """Initialise the model at both ends of the search space and between, and read the outputs at time 0.

    The model takes one output step at most, a system as many as its slowest component needs for one. What
    cannot be initialised is left out: the search itself reports such failures.

    Returns:
        The smaller and the larger value by output name; empty if the model could not be initialised.
    """
    space, experiment = problem.space, problem.experiment
    brief = replace(experiment, stop_time=_shortest(problem))
    found: list[dict[str, float]] = []
    low, high = space.bounds.T
    # Differences are often the same at both ends: between, each dimension has another share of its range.
    between = low + np.random.default_rng(0).random(len(low)) * (high - low)
    for point in (low, high, between):
        with suppress(CandidateError, ModelError, SimulationError):
            candidate = space.decode(point)
            outputs = problem.model.simulate(candidate.signals, numbers(problem, candidate), brief)
            found.append(outputs.at(0.0))
    names = [name for name in experiment.outputs if found and name in found[0]]
    return {name: (min(at[name] for at in found), max(at[name] for at in found)) for name in names}


def readable_internals(problems: Sequence[Problem], seconds: float | None = None) -> tuple[str, ...]:
    """Return the internal variables to record in a search; none if the model cannot be asked for them.

    To see that, the model is initialised in the middle of the search space, and steps as above, for so many s
    of wall-clock time at most. The problems differ only in their requirement.
    """
    problem = problems[0]
    space, experiment = problem.space, problem.experiment
    names = tuple(dict.fromkeys(name for p in problems for name in p.internals))
    brief = replace(
        experiment,
        stop_time=_shortest(problem),
        outputs=(*experiment.outputs, *names),
        time_limit=min((s for s in (experiment.time_limit, seconds) if s is not None), default=None),
    )
    with suppress(CandidateError, ModelError, SimulationError):
        if names:
            candidate = space.decode(space.bounds.mean(axis=1))
            problem.model.simulate(candidate.signals, numbers(problem, candidate), brief)
            return names
    return ()


def _shortest(problem: Problem) -> float:
    """Return the shortest simulation in s in which every component steps."""
    interval, model = problem.experiment.output_interval, problem.model
    steps = [part.step or 0.0 for part in model.parts.values()] if isinstance(model, System) else []
    return interval * max(1, ceil(max(steps, default=0.0) / interval * (1.0 - GRID_ROUNDING)))


def judge(problem: Problem, evaluation: Evaluation) -> Evaluation:
    """Evaluate the problem's requirement on a trajectory, also of a simulation for another requirement."""
    if evaluation.trajectory is None:
        return evaluation
    try:
        verdict = monitor_for(problem).evaluate(evaluation.trajectory)
        return replace(evaluation, status="ok", reason="", verdict=verdict)
    except MonitorError as error:
        return replace(evaluation, status="failed", verdict=None, reason=str(error), trajectory=None)


def monitor_for(problem: Problem) -> Monitor:
    """Return the monitor of the problem's requirement on its output grid, compiled once per process."""
    experiment = problem.experiment
    return compiled(problem.requirement.formula, experiment.output_interval, experiment.samples)


@lru_cache(maxsize=256)
def compiled(formula: Formula, step: float, samples: int) -> Monitor:
    """Return the monitor of a formula on samples that are a step in s apart, compiled once per process."""
    return Monitor(formula, step=step, samples=samples)


def numbers(problem: Problem, candidate: Candidate) -> dict[str, float]:
    """Return the parameters of a simulation and the values of inputs that keep theirs, by name.

    Also those that the model declares: an FMU may hold another one, of which nobody would be told.
    """
    inputs = (v for v in problem.info.inputs if v.name not in candidate.signals and not v.is_clocked)
    starts = {v.name: v.start_number for v in inputs if v.start_number is not None}
    return {**starts, **problem.parameters, **candidate.parameters}


def _with_inputs(problem: Problem, candidate: Candidate, outputs: Trajectory) -> Trajectory:
    """Return the trajectory with columns of the inputs, so that formulas and plots can use them."""
    columns = {name: signal.sample(outputs.times) for name, signal in candidate.signals.items()}
    for variable in problem.info.inputs:
        value = problem.parameters.get(variable.name, variable.start_number)
        if variable.name not in columns and value is not None:
            columns[variable.name] = np.full(outputs.times.shape, float(value))
        if variable.type == "Float32" and variable.name in columns:  # the FMU gets no more digits
            columns[variable.name] = columns[variable.name].astype(np.float32).astype(np.float64)
    units = {v.name: v.unit for v in problem.info.inputs if v.unit}
    return replace(outputs, columns={**outputs.columns, **columns}, units={**outputs.units, **units})
