"""The lag of falsifier.testing, easy and hard to falsify, slow and broken; by name, for other processes."""

import os
from collections.abc import Mapping
from time import sleep

import numpy as np

from falsifier.problem.problem import Problem
from falsifier.testing import Array, lag, lag_problem


def slow(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Take long enough that a campaign can be killed in the middle."""
    sleep(0.01)
    return lag(times, inputs, parameters)


def deadly(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """End the worker process."""
    os._exit(9)


def broken(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Give NaN whenever the input ends in the upper half of its range."""
    x = lag(times, inputs, parameters)["x"].copy()
    if inputs["u"][-1] > 0:
        x[5] = np.nan
    return {"x": x}


def never(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Fail always."""
    raise RuntimeError("out of order")


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
    return lag_problem(response=never, name="UNUSABLE")


def slow_hard() -> Problem:
    """Falsified by random inputs now and then, and slow."""
    return lag_problem("G[0,10] (x <= 0.85)", response=slow, name="SLOW")


def slow_impossible() -> Problem:
    """Never falsified, and slow."""
    return lag_problem("G[0,10] (x <= 2)", response=slow, name="SLOWER")


def worker_killer() -> Problem:
    """Every simulation ends the process that it runs in."""
    return lag_problem(response=deadly, name="DEADLY")
