"""``falsifier simulate``: the user's own inputs, judged and drawn."""

import csv
import json
from dataclasses import replace
from io import StringIO
from math import isfinite, nan
from pathlib import Path
from typing import Any

from falsifier.cli.command import command
from falsifier.cli.files import draw_evaluation
from falsifier.cli.options import (
    inputs_option,
    json_option,
    out_option,
    problem_source,
    requirement_options,
)
from falsifier.cli.output import conclude
from falsifier.core.candidate import Candidate
from falsifier.core.files import write_whole
from falsifier.core.literals import csv_cell, one_line
from falsifier.core.model import Variable
from falsifier.core.signals import Signal
from falsifier.core.space import InputRange, SearchSpace
from falsifier.core.trajectory import Trajectory
from falsifier.counterexamples.case import recorded_inputs
from falsifier.errors import SimulationError
from falsifier.evaluation.evaluate import Evaluation
from falsifier.evaluation.evaluate import simulate as simulate_inputs
from falsifier.evaluation.input_file import read_inputs
from falsifier.problem.joining import rights_notes
from falsifier.problem.loading import load_source
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from falsifier.views.terminal import warn
from falsifier.views.text import evaluation_json, evaluation_lines


@command()
@requirement_options
@inputs_option("Inputs to simulate")
@out_option("Directory for trajectory.csv, input.csv and trajectory.png.", metavar="DIR")
@json_option
def simulate(*, known: Path | None, out: Path | None, as_json: bool, **options: Any) -> None:
    """Simulate your own inputs and judge the requirement; ranges of the search do not apply.

    TARGET is a bundled problem (AT1), a spec file (my.toml or my.toml:REQ), or an FMU with --stl. Inputs that
    are not given keep the problem's fixed values or the model's start values.

    Exit codes: 0 not violated, 1 violated, 2 wrong usage or spec, 3 the simulation failed.
    """
    given = _numbers(options)
    source = problem_source(options)
    file, stored = _split(known, source)
    problem = load_source(source, searches=False)
    for note in rights_notes(problem.model):
        warn(note)
    try:
        driven = [v.name for v in problem.info.inputs]
        signals = {name: _constant(value) for name, value in given.items() if name in driven}
        parameters = {name: value for name, value in given.items() if name not in driven}
        evaluation = simulate_inputs(
            problem,
            {**_read(file, problem), **stored.signals, **signals},
            {**stored.parameters, **parameters},
        )
    finally:
        problem.model.close()
    if evaluation.trajectory is None or evaluation.verdict is None:
        raise SimulationError(f"{problem.name}: the simulation {_ended(evaluation)}")
    files = _written(problem, evaluation, evaluation.trajectory, out) if out else []
    conclude(
        json.dumps(_as_json(problem, evaluation, files), indent=2)
        if as_json
        else _as_text(problem, evaluation, files),
        1 if evaluation.violated else 0,
    )


def _numbers(options: dict[str, Any]) -> dict[str, float]:
    """Take the numbers of ``--set`` out of a command's keyword arguments: they may lie outside of ranges."""
    numbers, texts = dict[str, float](), list[str]()
    for option in options["values"]:
        name, equals, text = option.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = nan
        if equals and name.strip() and isfinite(value):
            numbers[name.strip()] = value
        else:
            texts.append(option)
    options["values"] = texts
    return numbers


def _split(known: Path | None, source: ProblemSource) -> tuple[Path | None, Candidate]:
    """Return the file of inputs, or what a counterexample or run holds; of the other, nothing."""
    if known is None or known.suffix.lower() == ".csv":
        return known, Candidate({})
    return None, recorded_inputs(known, source.name)


def _constant(value: float) -> Signal:
    return Signal((0.0,), (value,), "constant")


def _read(file: Path | None, problem: Problem) -> dict[str, Signal]:
    """Read the file of inputs; say on stderr what of it is not used."""
    if file is None:
        return {}
    found = read_inputs(file, problem.info)
    stop_time = problem.experiment.stop_time
    if found.unused:
        warn(f"{file}: not inputs of the model, and not used: {', '.join(found.unused)}")
    if found.end > stop_time:
        warn(f"{file}: ends at {found.end:g} s; the simulation at {stop_time:g} s: --stop-time changes it")
    if found.end < stop_time and any(len(s.times) > 1 for s in found.signals.values()):
        warn(f"{file}: ends at {found.end:g} s; the last values are kept until {stop_time:g} s")
    return dict(found.signals)


def _range(variable: Variable, signal: Signal) -> tuple[float, float]:
    """Return a range around a signal: the model's own, otherwise the signal's, wider if it is constant."""
    lowest, highest = min(signal.values), max(signal.values)
    wider = 1.0 if lowest == highest else 0.0
    low, high = variable.limits
    return lowest - wider if low is None else low, highest + wider if high is None else high


def _ended(evaluation: Evaluation) -> str:
    how = "timed out" if evaluation.status == "timeout" else evaluation.status
    return f"{how}: {evaluation.reason}"


def _written(problem: Problem, evaluation: Evaluation, trajectory: Trajectory, out: Path) -> list[Path]:
    from falsifier.counterexamples.export.tables import input_table, write_csv

    files = [write_whole(out / "trajectory.csv", _table(trajectory))]
    files.append(write_csv(input_table(problem, evaluation.candidate), out / "input.csv", problem.model))
    picture = draw_evaluation(_drawn(problem, evaluation), evaluation, out / "trajectory.png")
    return files if picture is None else [*files, picture]


def _table(trajectory: Trajectory) -> str:
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", *map(csv_cell, trajectory.names)])
    columns = [trajectory.times, *trajectory.columns.values()]
    writer.writerows(zip(*(column.tolist() for column in columns), strict=True))
    return text.getvalue()


def _drawn(problem: Problem, evaluation: Evaluation) -> Problem:
    """Return the problem with the given inputs instead of the searched ones, for the picture."""
    searched = {r.name: r for r in problem.space.inputs}
    inputs = tuple(
        _covering(searched[name], signal) if name in searched else _input_range(problem.info[name], signal)
        for name, signal in evaluation.candidate.signals.items()
    )
    return replace(problem, space=SearchSpace(inputs, (), problem.space.stop_time))


def _input_range(variable: Variable, signal: Signal) -> InputRange:
    return InputRange(variable.name, *_range(variable, signal), unit=variable.unit)


def _covering(searched: InputRange, signal: Signal) -> InputRange:
    low, high = min(searched.low, *signal.values), max(searched.high, *signal.values)
    return replace(searched, low=low, high=high)


def _as_text(problem: Problem, evaluation: Evaluation, files: list[Path]) -> str:
    shown = _drawn(problem, evaluation)
    verdict = "violated" if evaluation.violated else "not violated"
    lines = [f"{problem.name}: {verdict} by these inputs ({evaluation.seconds:.2f} s)"]
    lines.append(f"  requirement    {problem.requirement.formula}")
    lines += evaluation_lines(shown, evaluation)
    if files:
        lines.append(f"  files          {', '.join(map(str, files))}")
    return "\n".join(map(one_line, lines))


def _as_json(problem: Problem, evaluation: Evaluation, files: list[Path]) -> dict[str, Any]:
    return {
        "requirement": problem.name,
        "formula": str(problem.requirement.formula),
        "violated": evaluation.violated,
        **evaluation_json(evaluation),
        "files": list(map(str, files)),
    }
