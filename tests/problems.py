"""Small problems of Python functions, for tests that need no FMU."""

import os
from collections.abc import Mapping
from time import sleep

import numpy as np
from numpy.typing import NDArray

from falsifier.core.model import Experiment, FunctionModel, ModelInfo, Variable
from falsifier.core.space import Freedom, InputRange, ParameterRange, SearchSpace
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl import parse

Array = NDArray[np.float64]
STEP, STOP = 0.1, 10.0


def follow(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """First-order lag x' = gain * u - x from x0, by explicit Euler."""
    x = np.empty_like(times)
    x[0] = parameters.get("x0", 0.0)
    for k in range(1, len(times)):
        x[k] = x[k - 1] + STEP * (parameters.get("gain", 1.0) * inputs["u"][k - 1] - x[k - 1])
    return {"x": x}


def slow(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Take long enough that a campaign can be killed in the middle."""
    sleep(0.01)
    return follow(times, inputs, parameters)


def deadly(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """End the worker process."""
    os._exit(9)


def broken(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Give NaN whenever the input ends in the upper half of its range."""
    x = follow(times, inputs, parameters)["x"].copy()
    if inputs["u"][-1] > 0:
        x[5] = np.nan
    return {"x": x}


def mostly_broken(
    times: Array, inputs: dict[str, Array], parameters: dict[str, float]
) -> Mapping[str, Array]:
    """Give NaN unless the input ends in the lowest fifth of its range."""
    x = follow(times, inputs, parameters)["x"].copy()
    if inputs["u"][-1] > -0.6:
        x[5] = np.nan
    return {"x": x}


def never(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Fail always."""
    raise RuntimeError("out of order")


INFO = ModelInfo(
    "lag",
    "A first-order lag.",
    variables=(
        Variable("u", causality="input", unit="V", low=-1.0, high=1.0, start=0.0, description="drive"),
        Variable("x", causality="output", unit="m", description="position"),
        Variable("gain", causality="parameter", start=1.0, settable=True),
        Variable("x0", causality="parameter", start=0.0, settable=True),
    ),
)


def lag_problem(
    stl: str = "G[0,10] (x <= 0.9)",
    *,
    function: object = follow,
    points: int = 4,
    free: Freedom | None = None,
    parameters: tuple[ParameterRange, ...] = (),
    name: str = "LAG",
) -> Problem:
    """Problem over the lag: falsified only where u stays near its upper end for long."""
    drive = InputRange(
        "u",
        -1.0,
        1.0,
        control_points=points,
        interpolation="linear",
        free=free,
        unit="V",
        description="drive",
    )
    space = SearchSpace((drive,), parameters, STOP)
    model = FunctionModel(function, INFO)  # type: ignore[arg-type]
    return Problem(model, Requirement(name, parse(stl)), space, Experiment(STOP, STEP, ("x",)))


def easy() -> Problem:
    """Falsified by full input: one of the corners."""
    return lag_problem(name="EASY")


def hard() -> Problem:
    """Falsified by random inputs now and then."""
    return lag_problem("G[0,10] (x <= 0.6)", name="HARD")


def impossible() -> Problem:
    """Never falsified."""
    return lag_problem("G[0,10] (x <= 2)", name="NEVER")


def easy_again() -> Problem:
    """Another problem with a requirement of the same name."""
    return lag_problem("G[0,10] (x <= 0.8)", name="EASY")


def unusable() -> Problem:
    """Every simulation fails."""
    return lag_problem(function=never, name="UNUSABLE")


def slow_hard() -> Problem:
    """Falsified by random inputs now and then, and slow."""
    return lag_problem("G[0,10] (x <= 0.85)", function=slow, name="SLOW")


def slow_impossible() -> Problem:
    """Never falsified, and slow."""
    return lag_problem("G[0,10] (x <= 2)", function=slow, name="SLOWER")


def worker_killer() -> Problem:
    """Every simulation ends the process that it runs in."""
    return lag_problem(function=deadly, name="DEADLY")
