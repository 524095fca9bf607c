"""A lock and a safe that open after a sequence of inputs, which their robustness does not show."""

from collections.abc import Mapping

import numpy as np

from bench.example_systems import Array, function_problem
from falsifier.core.model import Kind
from falsifier.core.ranges import Freedom, InputRange
from falsifier.problem.problem import Problem

INTERVAL = 0.1
CODE = (3, 1, 4, 2, 5, 1, 3)
# A key or a turn counts if the previous one was at most this long ago, in s.
PATIENCE = 1.2
BANDS = ((2.1, 2.2), (0.7, 0.8))
TURNS = 6


def lock(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Count the right keys in a row; a wrong or a late one starts from the beginning. Seven open the lock."""
    done, since, last = 0, 0.0, 0
    shown, opened = np.zeros(len(times)), np.zeros(len(times))
    for k, key in enumerate(inputs["key"].astype(int).tolist()):
        since += INTERVAL
        if done < len(CODE):
            if since > PATIENCE:
                done = 0
            if key != last and key:
                done = done + 1 if key == CODE[done] else int(key == CODE[0])
                since = 0.0
        last = key
        shown[k], opened[k] = done, done == len(CODE)
    return {"stage": shown, "open": opened}


def safe(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Count how often the dial went from one narrow band to the other in time; six turns open the safe."""
    turns, since = 0, 0.0
    shown, opened = np.zeros(len(times)), np.zeros(len(times))
    for k, dial in enumerate(inputs["dial"].tolist()):
        since += INTERVAL
        low, high = BANDS[turns % 2]
        if low < dial < high and turns < TURNS:
            turns, since = turns + 1, 0.0
        elif since > PATIENCE and turns < TURNS:
            turns = 0
        shown[k], opened[k] = turns, turns == TURNS
    return {"turns": shown, "open": opened}


def safe_problem() -> Problem:
    """The safe must never open; each band is a thirtieth of the dial's range."""
    dial = InputRange("dial", 0.0, 3.0, interpolation="constant", free=Freedom(100, 0.1))
    outputs: dict[str, Kind] = {"turns": "integer", "open": "boolean"}
    return function_problem(safe, "G[0,10] (open < 0.5)", (dial,), (), outputs, 10.0, INTERVAL)


def lock_problem(*, points: int = 20, free: Freedom | None = None) -> Problem:
    """The lock must never open; of a million uniform inputs with twenty control points some 280 open it."""
    key = InputRange("key", 0, 5, control_points=points, interpolation="constant", free=free, kind="integer")
    outputs: dict[str, Kind] = {"stage": "integer", "open": "boolean"}
    return function_problem(lock, "G[0,10] (open < 0.5)", (key,), (), outputs, 10.0, INTERVAL)
