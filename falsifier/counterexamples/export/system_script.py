"""Script that simulates a counterexample of a system with FMPy: tables, and the text of fmpy_master."""

import ast
from collections.abc import Iterable, Mapping
from pathlib import Path
from pprint import pformat
from typing import Any

from falsifier.core.candidate import Candidate
from falsifier.core.literals import one_line, python_docstring
from falsifier.core.model import Model
from falsifier.core.trajectory import Trajectory
from falsifier.counterexamples.export.components import copy_of
from falsifier.evaluation.evaluate import Evaluation
from falsifier.fmu import System, fmpy_master
from falsifier.fmu.description import Description
from falsifier.fmu.stepper import is_held
from falsifier.fmu.systems.network import SYSTEM, Member, Network, Place
from falsifier.problem.problem import Problem

# Rows that replay.py prints before and after the critical time.
_SHOWN_ROWS = 3
_WIDTH = 110

_ABOUT = """\
Simulates a counterexample of a system with FMPy only; writes outputs.csv, compares the critical time.

    pip install fmpy
    python replay.py

{requirement}: {formula}
Recorded robustness {robustness:+.6g}, decided at t = {critical_time:.6g} s by {predicate}

The FMUs are those in components/, the inputs in input.csv. The tables of the system come first, see ``main``.
"""
_TOGETHER = """
In the recorded run, each component had a process of its own. Here all are in one: if their libraries
clash there, use `falsifier replay counterexample.json`, or the folders in components/.
"""

_SCRIPT = """\
{about}

from math import inf, nan  # start values in the table may be these

SYSTEM = {system}

{loop}

if __name__ == "__main__":
    main(SYSTEM, Path(__file__).resolve().parent)
"""


def why_no_script(model: Model) -> str:
    """Say why a system has no script for FMPy, and what to use in its place; empty for all other models."""
    members = model.network.members if isinstance(model, System) else ()
    solved = [m.name for m in members if m.interface == "model-exchange"]
    if not solved:
        return ""
    return (
        f"no replay.py: {', '.join(solved)} of model exchange would need the solver of falsifier; use "
        "`falsifier replay counterexample.json`, or the folders in components/"
    )


def system_script(problem: Problem, evaluation: Evaluation, columns: Iterable[str]) -> str | None:
    """Python script that needs only fmpy and numpy; None if the model is not a system that it can simulate.

    Args:
        problem: what was simulated.
        evaluation: the counterexample.
        columns: names of the columns of input.csv after the time.
    """
    model, verdict, trajectory = problem.model, evaluation.verdict, evaluation.trajectory
    if not isinstance(model, System) or verdict is None or trajectory is None or why_no_script(model):
        return None
    about = _ABOUT.format(
        requirement=one_line(problem.name),
        formula=one_line(str(problem.requirement.formula)),
        robustness=verdict.robustness,
        critical_time=verdict.critical_time,
        predicate=one_line(verdict.predicate),
    )
    about += _TOGETHER if model.network.coupling.isolation == "each" else ""
    system = {
        **_experiment(problem, model.network),
        "components": _components(problem, model, evaluation.candidate),
        "columns": list(columns),
        **_records(problem, model.network, trajectory, verdict.critical_time),
    }
    return _SCRIPT.format(
        about=python_docstring(about),
        system=pformat(system, width=_WIDTH, sort_dicts=False),
        loop=_loop(),
    )


def _loop() -> str:
    """Return the text of fmpy_master after its docstring."""
    text = Path(fmpy_master.__file__).read_text(encoding="utf-8")
    docstring = ast.parse(text).body[0]
    return "".join(text.splitlines(keepends=True)[docstring.end_lineno :]).strip() + "\n"


def _experiment(problem: Problem, network: Network) -> dict[str, Any]:
    experiment, coupling = problem.experiment, network.coupling
    every = max(round(experiment.output_interval / (experiment.step_size or experiment.output_interval)), 1)
    return {
        "stop_time": experiment.stop_time,
        "steps": (experiment.samples - 1) * every,
        "every": every,
        "tolerance": experiment.tolerance,
        "method": coupling.method,
        "convergence": coupling.tolerance,
        "max_rounds": coupling.max_rounds,
        "loops": dict(network.loops),
    }


def _records(
    problem: Problem, network: Network, trajectory: Trajectory, critical_time: float
) -> dict[str, Any]:
    places = {name: network.places[name] for name in problem.experiment.outputs}
    recorded = {
        name: (network.members[place.member].name, place.name)
        for name, place in places.items()
        if place.member != SYSTEM
    }
    shown = [name for name in recorded if name in problem.requirement.formula.signals]
    critical = int(abs(trajectory.times - critical_time).argmin())
    rows = range(max(critical - _SHOWN_ROWS, 0), min(critical + _SHOWN_ROWS + 1, len(trajectory.times)))
    return {
        "recorded": recorded,
        "shown": shown,
        "critical": critical,
        "expected": {k: [float(trajectory[name][k]) for name in shown] for k in rows},
    }


def _components(problem: Problem, model: System, candidate: Candidate) -> dict[str, dict[str, Any]]:
    network = model.network
    values: dict[str, float | str] = {**dict(model.frame.values), **problem.parameters}
    values |= {**candidate.parameters, **dict(problem.experiment.strings)}
    feeds = _feeds(model, candidate, values)
    start = {network.places[name]: value for name, value in values.items()}
    outputs = {link.source for link in network.links if link.source.member != SYSTEM}
    recorded = {network.places[name] for name in problem.experiment.outputs}
    step = problem.experiment.stop_time / _experiment(problem, network)["steps"]
    return {
        network.members[k].name: _component(
            network.members[k],
            step,
            start={p.name: value for p, value in start.items() if p.member == k and p not in feeds},
            feeds={p.name: feed for p, feed in feeds.items() if p.member == k},
            outputs=sorted(p.name for p in outputs if p.member == k),
            others=sorted(p.name for p in recorded if p.member == k),
        )
        for k in network.order
    }


def _component(
    member: Member,
    step: float,
    *,
    start: Mapping[str, float | str],
    feeds: Mapping[str, Mapping[str, Any]],
    outputs: list[str],
    others: list[str],
) -> dict[str, Any]:
    description = member.description
    used = dict.fromkeys((*start, *feeds, *outputs, *others))
    slots = {name: description.slots[name] for name in used}
    kinds = {v.name: v for v in description.info.variables}
    arrays = {s.reference: s for s in slots.values() if s.size > 1}
    return {
        "fmu": copy_of(member).as_posix(),
        "fmi": description.major,
        "token": description.token,
        "identifier": description.identifiers[member.interface],
        "event_mode": description.major == 3 and description.event_mode,
        "every": 1 if member.step is None else round(member.step / step),
        "variables": {name: (s.type, s.reference, s.offset, s.size) for name, s in slots.items()},
        "arrays": {reference: _elements(description, reference) for reference in arrays},
        "start": dict(start),
        "inputs": dict(feeds),
        "held": [name for name in feeds if is_held(description, member.interface, kinds[name])],
        "outputs": outputs,
    }


def _elements(description: Description, reference: int) -> list[float]:
    return [float(value) for value in description.arrays[reference]]


def _feeds(
    model: System, candidate: Candidate, values: Mapping[str, float | str]
) -> dict[Place, dict[str, Any]]:
    """Return where each input comes from: a connected output, a column of input.csv, or a constant."""
    network = model.network
    feeds: dict[Place, dict[str, Any]] = {}
    for link in network.links:
        feed: dict[str, Any] = {"factor": link.factor, "offset": link.offset}
        if link.source.member != SYSTEM:
            feed |= {"from": network.title(link.source), "value": link.start, "linear": link.is_linear}
        elif link.source.name in candidate.signals:
            feed |= {"input": link.source.name}
        else:
            constant = values.get(link.source.name, model.info[link.source.name].start)
            feed |= {"value": float(constant or 0.0)}
        feeds[link.target] = feed
    for name in candidate.signals:
        if network.places[name].member != SYSTEM:
            feeds[network.places[name]] = {"factor": 1.0, "offset": 0.0, "input": name}
    return feeds
