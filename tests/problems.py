"""The lag of falsifier.testing, easy and hard to falsify, slow and broken; by name, for other processes."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from falsifier.core.ranges import ParameterRange, Scale
from falsifier.problem.problem import Problem
from falsifier.testing import Array, lag, lag_problem
from tests.patience import wait_until

Columns = dict[str, Array]
# Names an environment variable, "COUNT FOLDER": what is held there after so many simulations have begun.
HOLD = "FALSIFIER_TESTS_HOLD"
BEGUN, RELEASE = "begun", "release"


def held(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Wait for the folder's file ``release`` once enough simulations began: a campaign is killed then."""
    if HOLD in os.environ:
        count, _, folder = os.environ[HOLD].partition(" ")
        with (Path(folder) / BEGUN).open("ab") as file:
            file.write(b".")
        if (Path(folder) / BEGUN).stat().st_size > int(count):
            wait_until((Path(folder) / RELEASE).exists)
    return lag(times, inputs, parameters)


def deadly(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """End the worker process."""
    os._exit(9)


def broken(
    times: Array, inputs: Columns, parameters: dict[str, float], above: float = 0.0
) -> Mapping[str, Array]:
    """Give NaN whenever the input ends in the upper half of its range, or above another number."""
    x = lag(times, inputs, parameters)["x"].copy()
    if inputs["u"][-1] > above:
        x[5] = np.nan
    return {"x": x}


def mostly_broken(times: Array, inputs: Columns, parameters: dict[str, float]) -> Mapping[str, Array]:
    """Give NaN unless the input ends in the lowest fifth of its range."""
    return broken(times, inputs, parameters, above=-0.6)


def straight(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Give the parameter ``bias`` itself: what can be reached, and how probably, is known."""
    return {"x": np.full(times.shape, parameters["bias"])}


def exponent(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Give the decimal logarithm of the parameter ``bias``."""
    return {"x": np.full(times.shape, np.log10(parameters["bias"]))}


def decades(
    formula: str = "G[0,10] (x <= -5 or x >= -4.52)", *, inputs: int = 0, scale: Scale = "log"
) -> Problem:
    """Falsified where ``bias``, from 1e-7 to 1, is between 1e-5 and 3e-5; its exponent is x."""
    bias = ParameterRange("bias", 1e-7, 1.0, scale=scale)
    return lag_problem(formula, inputs=inputs, parameters=[bias], response=exponent, name="DECADES")


def still(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Give 0, whatever the input is."""
    return {"x": np.zeros_like(times)}


def never(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Fail always."""
    raise RuntimeError("out of order")


def stepped(problem: Problem) -> Problem:
    """Return a problem whose outputs, as the model says, change at events only."""
    model: Any = problem.model
    variables = [replace(v, variability="discrete") for v in problem.info.variables]
    return replace(problem, model=replace(model, info=replace(model.info, variables=tuple(variables))))


def easy() -> Problem:
    """Falsified by full input: one of the corners."""
    return lag_problem(name="EASY")


def hard() -> Problem:
    """Falsified by random inputs now and then."""
    return lag_problem("G[0,10] (x <= 0.6)", name="HARD")


def conditional() -> Problem:
    """Violated by an input just above 0.9; then the robustness is decided by that condition."""
    return lag_problem("G[0,10] (u >= 0.9 -> x <= 0.5)", name="COND")


def impossible() -> Problem:
    """Never falsified."""
    return lag_problem("G[0,10] (x <= 2)", name="NEVER")


def easy_again() -> Problem:
    """Another problem with a requirement of the same name."""
    return lag_problem("G[0,10] (x <= 0.8)", name="EASY")


def unusable() -> Problem:
    """Every simulation fails."""
    return lag_problem(response=never, name="UNUSABLE")


def held_hard() -> Problem:
    """Falsified by random inputs now and then; can be held."""
    return lag_problem("G[0,10] (x <= 0.85)", response=held, name="HELD-HARD")


def held_impossible() -> Problem:
    """Never falsified; can be held."""
    return lag_problem("G[0,10] (x <= 2)", response=held, name="HELD-NEVER")


def worker_killer() -> Problem:
    """Every simulation ends the process that it runs in."""
    return lag_problem(response=deadly, name="DEADLY")
