"""Eight machines of states and counters as Python functions, and what they must not do.

They belong to the collection that ``bench/function_systems.py`` searches; the helpers here serve both files.
"""

from collections.abc import Callable, Mapping
from functools import partial
from math import copysign

import numpy as np

from bench.example_systems import Array, function_problem
from falsifier.core.model import Kind
from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.problem.problem import Problem
from falsifier.testing import Response


def held(name: str, low: float, high: float, points: int) -> InputRange:
    """Return an input of real numbers that are held between control points."""
    return InputRange(name, low, high, control_points=points, interpolation="constant")


def line(name: str, low: float, high: float, points: int) -> InputRange:
    """Return an input of real numbers, straight between control points."""
    return InputRange(name, low, high, control_points=points, interpolation="linear")


def numbers(name: str, low: float, high: float, points: int) -> InputRange:
    """Return an input of integers."""
    return InputRange(name, low, high, kind="integer", control_points=points, interpolation="constant")


def switch(name: str, points: int) -> InputRange:
    """Return an input that is 0 or 1."""
    return InputRange(name, 0, 1, kind="integer", control_points=points, interpolation="constant")


def whole(values: Array) -> list[int]:
    """Return the values of an input of whole numbers, one per time."""
    return [int(value) for value in np.rint(values).tolist()]


def columns(rows: list[tuple[float, ...]], *names: str) -> Mapping[str, Array]:
    """Return the outputs by name from one row per time."""
    return dict(zip(names, np.array(rows, dtype=float).T, strict=True))


def requirements(
    function: Response,
    formulas: Mapping[str, str],
    outputs: Mapping[str, Kind],
    *,
    inputs: tuple[InputRange, ...] = (),
    parameters: tuple[ParameterRange, ...] = (),
    stop: float,
    interval: float,
) -> dict[str, Callable[[], Problem]]:
    """Return what makes the problem of each formula, by its name."""
    return {
        name: partial(function_problem, function, formula, inputs, parameters, outputs, stop, interval)
        for name, formula in formulas.items()
    }


def keypad(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A lock that opens with 3, 7, 1, 9; every fourth wrong key blocks it for 3 s."""
    code = (3, 7, 1, 9)
    digits = wrong = blocked = 0
    last = -1
    rows: list[tuple[float, ...]] = []
    for key in whole(inputs["key"]):
        if blocked > 0:
            blocked -= 1
        elif key not in (last, 0) and digits < 4:
            if key == code[digits]:
                digits += 1
            else:
                digits = 0
                wrong += 1
                if wrong % 4 == 0:
                    blocked = 30
        last = key
        shown = 0 if wrong >= 3 and digits < 1 else wrong
        rows.append((digits, shown, blocked > 0))
    return columns(rows, "digits", "wrong", "locked")


def elevator(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """An elevator of three floors; it stays with a load of 800 kg, and its motor heats up, most upwards."""
    floor, temperature = 0.0, 20.0
    door = waiting = starts = 0
    target: int | None = None
    calls = [whole(inputs[f"call{level}"]) for level in range(3)]
    rows: list[tuple[float, ...]] = []
    for k, load in enumerate(inputs["load"].tolist()):
        if waiting > 0:
            waiting -= 1
        else:
            door = 0
            if target is None:
                called = [level for level in range(3) if calls[level][k] and abs(level - floor) > 0.1]
                if called and load < 800:
                    target = called[0]
                    starts += 1
            if target is not None:
                direction = copysign(1.0, target - floor)
                floor += 0.25 * direction
                temperature += 2.0 * (0.5 + load / 1000) * (1.3 if direction > 0 else 0.6)
                if abs(floor - target) < 0.1:
                    floor = float(target)
                    target = None
                    door = 1
                    waiting = 6
        temperature += (20 - temperature) * 0.02
        rows.append((round(floor), door, temperature, starts))
    return columns(rows, "floor", "door", "motor", "starts")


def vending(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A machine that sells for two coins; to cancel in the last moment of a sale costs two more."""
    money = items = state = remaining = 0
    coins, selections, cancels = (whole(inputs[name]) for name in ("coin", "select", "cancel"))
    last = (0, 0, 0)
    rows: list[tuple[float, ...]] = []
    for now in zip(coins, selections, cancels, strict=True):
        coin, select, cancel = (new and not old for new, old in zip(now, last, strict=True))
        last = now
        if state == 0:
            if coin:
                money += 1
            if select and money >= 2:
                state = 1
                remaining = 4
            elif cancel and money > 0:
                state = 2
                remaining = 2
        elif state == 1:
            remaining -= 1
            if cancel and remaining <= 1:
                money -= 2
            if remaining == 0:
                items += 1
                money -= 2
                state = 0
        else:
            remaining -= 1
            if remaining == 0:
                money = 0
                state = 0
        rows.append((money, items, state))
    return columns(rows, "credit", "items", "state")


def debounce(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A counter of pulses of at most 1 s; it fails at the fourth if the last three began within 4.5 s."""
    count = faults = last = 0
    begun: list[int] = []
    resets = whole(inputs["reset"])
    rows: list[tuple[float, ...]] = []
    for k, pulse in enumerate(whole(inputs["pulse"])):
        if pulse and not last:
            begun.append(k)
        if last and not pulse and k - begun[-1] <= 4:
            count += 1
        last = pulse
        begun = begun[-3:]
        if resets[k]:
            count = 0
        if count >= 4 and len(begun) == 3 and begun[-1] - begun[0] <= 18:
            faults += 1
            count = 0
        rows.append((count, faults, begun[-1] * 0.25 if begun else 0.0))
    return columns(rows, "count", "fault", "window")


def resending(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A sender that repeats a message until an acknowledgement comes in time, numbered modulo four."""
    number = expected = delivered = duplicates = waiting = 0
    lost_answers = whole(inputs["ackloss"])
    delays = inputs["delay"].tolist()
    rows: list[tuple[float, ...]] = []
    for k, lost in enumerate(whole(inputs["loss"])):
        if waiting > 0:
            waiting -= 1
        elif lost:
            waiting = 2
        else:
            if number % 4 == expected:
                delivered += 1
                expected = (expected + 1) % 4
            else:
                duplicates += 1
            if not lost_answers[k] and delays[k] < 4:
                number += 1
            waiting = int(delays[k])
        rows.append((number, delivered, duplicates))
    return columns(rows, "sequence", "delivered", "duplicates")


def washer(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A machine that fills, heats, washes, drains and ends; until it drains, an open door starts it again."""
    level, temperature = 0.0, 15.0
    phase = since = 0
    filling = inputs["fill"].tolist()
    doors = whole(inputs["door"])
    rows: list[tuple[float, ...]] = []
    for k, heating in enumerate(inputs["heat"].tolist()):
        if doors[k]:
            phase = 0 if phase < 3 else phase
            since = 0
        level = min(1, max(0, level + 0.01 * filling[k] - (0.02 if phase == 3 else 0.003)))
        temperature += 0.6 * heating * (1 if level > 0.2 else 0.1) - 0.01 * (temperature - 15)
        since += 1
        if phase == 0 and level > 0.3 and not doors[k]:
            phase = 1
            since = 0
        elif phase == 1 and temperature > 40 and since > 10:
            phase = 2
            since = 0
        elif phase == 2 and since > 30 and temperature < 38:
            phase = 3
            since = 0
        elif phase == 3 and level < 0.05:
            phase = 4
        rows.append((level, temperature, phase))
    return columns(rows, "level", "temp", "phase")


def parity(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A count of the edges of a clock at which a bit equals the parity of the edges; it can be cleared."""
    odd = run = last = 0
    bits = whole(inputs["bit"])
    clears = whole(inputs["clear"])
    rows: list[tuple[float, ...]] = []
    for k, clock in enumerate(whole(inputs["clock"])):
        if clock != last:
            odd ^= 1
            if clears[k]:
                run = 0
            elif bits[k] == odd:
                run += 1
        last = clock
        rows.append((odd, run))
    return columns(rows, "parity", "run")


def crossing(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A level crossing of two tracks; a car stops its gate from closing, which opens fully once it opens."""
    first, second, gate = 600.0, 800.0, 1.0
    state = 0
    speeds = inputs["train2"].tolist()
    cars = whole(inputs["car"])
    rows: list[tuple[float, ...]] = []
    for k, speed in enumerate(inputs["train1"].tolist()):
        first -= 0.25 * speed
        second -= 0.25 * speeds[k]
        near = -50 < first < 200 or -50 < second < 200
        if state == 0 and near:
            state = 1
        elif state == 1:
            if not (cars[k] and gate > 0.4):
                gate = max(0, gate - 0.05)
            if not near:
                state = 2
        elif state == 2:
            gate = min(1, gate + 0.02)
            if gate >= 1:
                state = 0
        rows.append((gate, first, second, state))
    return columns(rows, "gate", "train1_distance", "train2_distance", "state")


MACHINES: dict[str, Callable[[], Problem]] = {
    **requirements(
        keypad,
        {
            "keypad second digit": "G (digits <= 1)",
            "keypad third digit": "G (digits <= 2)",
            "keypad wrong keys": "G (wrong <= 6)",
        },
        {"digits": "integer", "wrong": "integer", "locked": "integer"},
        inputs=(InputRange("key", 0, 9, kind="integer", control_points=10, interpolation="constant"),),
        stop=20.0,
        interval=0.1,
    ),
    **requirements(
        elevator,
        {
            "elevator starts": "G (starts <= 15)",
            "elevator hot at the top": "G (not (floor >= 1.5 and door >= 0.5 and motor >= 62))",
            "elevator motor": "G (motor <= 74)",
        },
        {"floor": "integer", "door": "integer", "motor": "real", "starts": "integer"},
        inputs=(*(switch(f"call{level}", 20) for level in range(3)), held("load", 0, 1000, 10)),
        stop=100.0,
        interval=0.5,
    ),
    **requirements(
        vending,
        {
            "vending third item": "G (items <= 2)",
            "vending credit": "G (credit >= 0)",
            "vending fourth item": "G (items <= 3)",
        },
        {"credit": "integer", "items": "integer", "state": "integer"},
        inputs=(switch("coin", 24), switch("select", 24), switch("cancel", 24)),
        stop=48.0,
        interval=0.5,
    ),
    **requirements(
        debounce,
        {
            "debounce fourth pulse": "G (count <= 3)",
            "debounce sixth pulse": "G (count <= 5)",
            "debounce fault": "G (fault <= 0.5)",
        },
        {"count": "integer", "fault": "integer", "window": "real"},
        inputs=(switch("pulse", 40), switch("reset", 20)),
        stop=40.0,
        interval=0.25,
    ),
    **requirements(
        resending,
        {"resending easy": "G (duplicates <= 29)", "resending hard": "G (duplicates <= 35)"},
        {"sequence": "integer", "delivered": "integer", "duplicates": "integer"},
        inputs=(switch("loss", 30), switch("ackloss", 30), held("delay", 0, 5, 10)),
        stop=60.0,
        interval=0.5,
    ),
    **requirements(
        washer,
        {"washer drains": "G (phase <= 2)", "washer ends": "G (phase <= 3)"},
        {"level": "real", "temp": "real", "phase": "integer"},
        inputs=(held("heat", 0, 1, 10), held("fill", 0, 1, 8), switch("door", 12)),
        stop=120.0,
        interval=0.5,
    ),
    **requirements(
        parity,
        {"parity fourth edge": "G (run <= 3)", "parity sixth edge": "G (run <= 5)"},
        {"parity": "integer", "run": "integer"},
        inputs=(switch("clock", 16), switch("bit", 16), switch("clear", 16)),
        stop=32.0,
        interval=0.5,
    ),
    **requirements(
        crossing,
        {
            "crossing one train": "G (not (gate >= 0.8 and train1_distance <= 0 and train1_distance >= -40))",
            "crossing two trains": "G (not (gate >= 0.9 and train1_distance <= 0 and train1_distance >= -20"
            " and train2_distance <= 0 and train2_distance >= -40))",
        },
        {"gate": "real", "train1_distance": "real", "train2_distance": "real", "state": "integer"},
        inputs=(held("train1", 0, 30, 8), held("train2", 0, 30, 8), switch("car", 20)),
        stop=80.0,
        interval=0.25,
    ),
}
