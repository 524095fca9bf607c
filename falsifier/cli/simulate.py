"""``falsifier simulate``: the user's own inputs, judged and drawn."""

from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from falsifier.cli.command import command
from falsifier.cli.files import draw_evaluation, made_folder, saved
from falsifier.cli.options import inputs_option, json_option, out_option, problem_source, requirement_options
from falsifier.cli.output import FAILED, as_shown, conclude
from falsifier.core.candidate import Candidate
from falsifier.core.experiment import GRID_ROUNDING
from falsifier.core.files import write_whole
from falsifier.core.literals import csv_text, number_in, one_line
from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace
from falsifier.core.words import readable
from falsifier.counterexamples.case import read_known
from falsifier.errors import SimulationError
from falsifier.evaluation.evaluate import Evaluation, simulate as simulate_inputs
from falsifier.fmu import is_solved
from falsifier.problem.joining import rights_notes, unit_notes
from falsifier.problem.loading import load_source
from falsifier.problem.problem import Problem
from falsifier.problem.ranges import value_kind
from falsifier.problem.source import ProblemSource
from falsifier.views.terminal import warn
from falsifier.views.text import evaluation_facts, evaluation_json, fact_lines, problem_json

# What --out is to hold.
_FILES = ("trajectory.csv", "input.csv", "trajectory.png")


@command()
@partial(requirement_options, searches=False)
@inputs_option("Inputs to simulate")
@out_option("New directory for trajectory.csv, input.csv and trajectory.png.", metavar="DIR")
@json_option
def simulate(*, place: Path | None, out: Path | None, as_json: bool, **options: Any) -> None:
    """Simulate your own inputs and judge the requirement; ranges of the search do not apply.

    TARGET is a bundled problem (AT1), a spec file (my.toml or my.toml:REQ), or an FMU with --stl. Inputs that
    are not given keep the problem's fixed values or the model's start values.

    Exit codes: 0 not violated, 1 violated, 2 wrong usage or spec, 3 the simulation failed.
    """
    source, given = _without_numbers(stated := problem_source(options))
    problem = load_source(source, searches=False)
    for note in (*problem.info.notes, *rights_notes(problem.model)):
        warn(note)
    with closing(problem.model):
        inputs = {v.name for v in problem.info.inputs}
        given |= {n: problem.parameters[n] for n in source.changes.parameters if n in problem.parameters}
        read, file_notes = (Candidate({}), []) if place is None else read_known(place, problem)
        for note in file_notes:
            warn(f"{place}: {note}")
        constant = {n: Signal((0.0,), (value,), "constant") for n, value in given.items() if n in inputs}
        signals = {**read.signals, **constant}
        held = {n: (value, value) for n, value in given.items() if n in problem.info}
        for note in unit_notes(problem.model, held):
            warn(note)
        tried = {n: (min(s.values), max(s.values)) for n, s in signals.items() if n in inputs}
        for name, (low, high) in (tried | held).items():
            if excess := problem.info[name].excess(low, high):
                warn(f"{name}: {f'{low:.12g}' if low == high else f'[{low:.12g}, {high:.12g}]'} {excess}")
        for name, signal in signals.items():
            if note := _unseen(problem, name, signal):
                warn(note)
        known = {*signals, *read.parameters, *given}
        if known and (kept := [n for n in problem.space.names if n not in known]):
            warn(f"no values given for {', '.join(kept)}: kept at the model's start value")
        if inputs and not known:
            warn(
                f"{problem.name}: no inputs given: all keep the problem's fixed values or the model's start "
                "values; --inputs u.csv or --set NAME=VALUE sets them"
            )
        if out is not None:
            made_folder(out)
        numbers = {n: value for n, value in given.items() if n not in inputs}
        typed = stated.changes.parameters
        strings = {v.name for v in problem.info.variables if v.kind == "string"}
        texts = {n: t for n in strings & numbers.keys() if isinstance(t := typed[n].value, str)}
        evaluation = simulate_inputs(problem, signals, {**read.parameters, **numbers, **texts})
    if evaluation.verdict is None:
        raise SimulationError(f"{problem.name}: the simulation {evaluation.outcome}")
    drawn = _with_own_ranges(problem, evaluation.candidate)
    files = _written(problem, drawn, evaluation, out) if out else []
    verdict = "violated" if evaluation.violated else "not violated"
    head = f"{problem.name}: {verdict}{' by these inputs' if inputs else ''} ({evaluation.seconds:.2f} s)"
    facts = [("requirement", str(problem.requirement.formula)), *evaluation_facts(drawn, evaluation)]
    facts += [("files", ", ".join(map(str, files)))] if files else []
    content = {**problem_json(problem), **evaluation_json(evaluation), "files": list(map(str, files))}
    text = "\n".join(map(one_line, [head, *fact_lines(facts)]))
    is_lost = out is not None and len(files) < len(_FILES)
    code = FAILED if is_lost else 1 if evaluation.violated else 0
    conclude(as_shown(text, content, as_json=as_json), code)


def _without_numbers(source: ProblemSource) -> tuple[ProblemSource, dict[str, float]]:
    """Take the numbers of ``--set`` out of a source: they may lie outside of ranges."""
    stated = source.changes.parameters
    said = {name: number_in(s.value) for name, s in stated.items() if s.value is not None}
    numbers = {name: number for name, number in said.items() if number is not None}
    others = {name: section for name, section in stated.items() if name not in numbers}
    changes = source.changes.model_copy(update={"parameters": others})
    return source.model_copy(update={"changes": changes}), numbers


def _unseen(problem: Problem, name: str, signal: Signal) -> str:
    """Say that a signal changes faster than the model is given inputs; empty if it does not."""
    dwell, step = signal.shortest_dwell, problem.experiment.step
    if dwell is None or dwell > step * (1.0 - GRID_ROUNDING) or is_solved(problem.model):
        return ""
    return (
        f"{name}: changes {readable(dwell)} s apart may not be seen, as inputs are set every {step:g} s: "
        "state a smaller --output-interval, or step_size in a spec"
    )


def _with_own_ranges(problem: Problem, candidate: Candidate) -> Problem:
    """Return the problem with the given inputs and parameters instead of the searched, for text and picture.

    Ranges are those of the search or else of the model, as far as they are known, and hold all values.
    """
    searched = {r.name: r for r in problem.space.inputs}
    inputs = []
    for name, signal in candidate.signals.items():
        own, variable = searched.get(name), problem.info[name]
        limits = variable.limits if own is None else (own.low, own.high)
        values = [*signal.values, *(limit for limit in limits if limit is not None)]
        room = 1.0 if min(values) == max(values) else 0.0
        low, high = min(values) - room, max(values) + room
        if own is None:
            kind = value_kind(variable)
            own = InputRange(name, low, high, unit=variable.unit, kind=kind, items=variable.items)
        inputs.append(replace(own, low=low, high=high))
    chosen = ((problem.info[name], value) for name, value in candidate.parameters.items())
    parameters = tuple(
        ParameterRange(v.name, x, x, unit=v.unit, kind=value_kind(v), items=v.items) for v, x in chosen
    )
    return replace(problem, space=SearchSpace(tuple(inputs), parameters, problem.space.stop_time))


def _written(problem: Problem, drawn: Problem, evaluation: Evaluation, out: Path) -> list[Path]:
    from falsifier.counterexamples.export.tables import input_table, write_csv

    trajectory = evaluation.trajectory
    assert trajectory is not None, "what was judged has a trajectory"
    rows = zip(trajectory.times.tolist(), *(c.tolist() for c in trajectory.columns.values()), strict=True)
    outputs, inputs = [["time", *trajectory.names], *rows], input_table(problem, evaluation.candidate)
    trajectory_file, input_file, picture = (out / name for name in _FILES)
    return [
        *saved(trajectory_file, lambda file: write_whole(file, csv_text(outputs))),
        *saved(input_file, lambda file: write_csv(inputs, file, problem.model)),
        *draw_evaluation(drawn, evaluation, picture),
    ]
