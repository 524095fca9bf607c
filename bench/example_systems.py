"""Four small requirements on which the default engine was developed: staircases, and parameters only.

``python bench/example_systems.py`` prints how many simulations the engines need; a miss counts as the budget.
The figure after the @ is the number of runs with a violation. Committed table: ``bench/unseen.md``.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from statistics import mean

import numpy as np
from numpy.typing import NDArray

from bench.search import seeds_from, with_error
from falsifier import ENGINES as ALL_ENGINES, falsify
from falsifier.core.experiment import Experiment
from falsifier.core.function_model import FunctionModel
from falsifier.core.model import Kind, ModelInfo, Variable
from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.core.space import SearchSpace
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl import parse
from falsifier.testing import Response

Array = NDArray[np.float64]
ENGINES = ("surrogate", "uniform", "corners", "cma", "optuna", "coverage")


def commands(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Count commands 1 to 4 that come in this order, each within 5 s; a late one starts again."""
    stage, since = 0, 0.0
    shown = np.zeros(len(times))
    for k, command in enumerate(np.rint(inputs["command"]).astype(int).tolist()):
        since += float(times[1])
        if stage and since > 5.0 and stage < 4:
            stage = 0
        if stage < 4 and command == stage + 1:
            stage, since = stage + 1, 0.0
        shown[k] = stage
    return {"stage": shown}


def brake(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A unit that is corrupted by two dips of the voltage within 5 s while the count of presses is odd."""
    presses, level, since, pressed, low = 0, 0, 0.0, False, False
    shown, counted = np.zeros(len(times)), np.zeros(len(times))
    for k, (pedal, voltage) in enumerate(
        zip(inputs["pedal"].tolist(), inputs["voltage"].tolist(), strict=True)
    ):
        since += float(times[1])
        if pedal > 0.7 and not pressed:
            presses += 1
        if level and since > 5.0 and level < 3:
            level = 0
        dips = voltage < 7.0 and not low
        if dips and presses % 2 and level < 2:
            level, since = level + 1, 0.0
        elif level == 2 and pedal > 0.9:
            level = 3
        pressed, low = pedal > 0.7 if pedal > 0.7 else pedal > 0.3 and pressed, voltage < 7.0
        shown[k], counted[k] = level, presses
    return {"corruption": shown, "presses": counted}


def suspension(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A quarter of a car on a bumpy road."""
    p, step = parameters, float(times[1])
    body = wheel = body_speed = wheel_speed = 0.0
    travel, load = np.zeros(len(times)), np.zeros(len(times))
    for k, time in enumerate(times.tolist()):
        road = p["bump"] * np.sin(2 * np.pi * p["frequency"] * time) * (time < p["length"])
        gap = body - wheel
        spring = p["stiffness"] * gap + 2e5 * gap**3
        damper = p["damping"] * (body_speed - wheel_speed)
        tyre = p["tyre"] * (road - wheel)
        body_speed -= step * (spring + damper) / p["mass"]
        wheel_speed += step * (spring + damper + tyre) / p["wheel"]
        body += step * body_speed
        wheel += step * wheel_speed
        travel[k], load[k] = gap, tyre
    return {"travel": travel, "load": load}


def function_problem(
    function: Response,
    formula: str,
    inputs: tuple[InputRange, ...],
    parameters: tuple[ParameterRange, ...],
    outputs: Mapping[str, Kind],
    stop: float,
    interval: float,
) -> Problem:
    """Return the problem of a formula over the outputs of a Python function, sampled at the interval (s)."""
    variables = (
        *(
            Variable(r.name, causality="input", kind=r.kind, low=r.low, high=r.high, start=r.low)
            for r in inputs
        ),
        *(Variable(r.name, causality="parameter", start=r.low, settable=True) for r in parameters),
        *(Variable(name, causality="output", kind=kind) for name, kind in outputs.items()),
    )
    return Problem(
        FunctionModel(function, ModelInfo("example", variables=variables)),
        Requirement("R", parse(formula)),
        SearchSpace(inputs, parameters, stop),
        Experiment(stop, interval, tuple(outputs)),
    )


def commands_problem() -> Problem:
    """Four commands in the right order must not happen."""
    command = InputRange("command", 0, 7, kind="integer", control_points=12, interpolation="constant")
    return function_problem(commands, "G[0,24] (stage <= 3)", (command,), (), {"stage": "integer"}, 24.0, 0.1)


def brake_problem() -> Problem:
    """The unit is never corrupted fully."""
    inputs = (
        InputRange("pedal", 0.0, 1.0, control_points=8, interpolation="constant"),
        InputRange("voltage", 5.0, 14.0, control_points=12, interpolation="linear"),
    )
    outputs: dict[str, Kind] = {"corruption": "integer", "presses": "integer"}
    return function_problem(brake, "G[0,20] (corruption <= 2)", inputs, (), outputs, 20.0, 0.05)


def suspension_problem(formula: str) -> Problem:
    """Eight parameters."""
    ranges = {
        "mass": (200.0, 500.0), "wheel": (25.0, 60.0), "stiffness": (8e3, 4e4), "damping": (300.0, 3000.0),
        "tyre": (1e5, 3e5), "bump": (0.01, 0.06), "frequency": (0.5, 6.0), "length": (0.2, 4.0),
    }  # fmt: skip
    parameters = tuple(ParameterRange(name, low, high) for name, (low, high) in ranges.items())
    return function_problem(
        suspension, formula, (), parameters, {"travel": "real", "load": "real"}, 5.0, 0.002
    )


PROBLEMS: dict[str, Callable[[], Problem]] = {
    "commands": commands_problem,
    "brake": brake_problem,
    "suspension1": lambda: suspension_problem("G[0,5] (travel <= 0.11)"),
    "suspension2": lambda: suspension_problem("G[0,3] (travel <= 0.11) or G[0,5] (load <= 9500)"),
}


def compare(problems: Mapping[str, Callable[[], Problem]], description: str | None) -> None:
    """Read the options of the command line and print the table, row by row, with the means last."""
    parser = argparse.ArgumentParser(description=description)
    known = sorted(set(ALL_ENGINES) - {"hybrid"})
    parser.add_argument("--engines", nargs="+", choices=known, default=ENGINES)
    parser.add_argument("--requirements", nargs="+", choices=problems, default=list(problems), metavar="NAME")
    parser.add_argument("--seeds", type=seeds_from, default=range(10), help="for example 0-9")
    parser.add_argument("--budget", type=int, default=300)
    parser.add_argument("--free", type=int, metavar="PIECES", help="inputs may have so many control points")
    options = parser.parse_args()
    print(f"| requirement | {' | '.join(options.engines)} |\n|{'---|' * (len(options.engines) + 1)}")
    means: dict[str, list[float]] = {engine: [] for engine in options.engines}
    for name in options.requirements:
        cells = [name]
        for engine in options.engines:
            problem, counts, found = problems[name](), [], 0
            if options.free and problem.space.inputs:
                shortest = problem.space.stop_time / options.free
                problem = replace(problem, space=problem.space.freed(shortest))
            for seed in options.seeds:
                result = falsify(problem, engine, seed=seed, budget=options.budget)
                counts.append(result.spent.simulations if result.falsified else options.budget)
                found += result.falsified
            cells.append(f"{with_error(counts)} @ {found}")
            means[engine].append(mean(counts))
        print(f"| {' | '.join(cells)} |", flush=True)
    print(f"| {' | '.join(['mean', *(f'{mean(row):.1f}' for row in means.values())])} |")


if __name__ == "__main__":
    compare(PROBLEMS, __doc__)
