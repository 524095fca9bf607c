"""Which engine finds the violations of 17 small systems of states, counters, slopes and parameters?

``python -m bench.function_systems`` prints the table of ``bench/example_systems.py`` for 42 requirements: of
the nine systems in this file and of the eight machines. They were written after an engine was
finished; ``bench/unseen.md`` says what was changed after them.
"""

from collections.abc import Callable, Mapping
from math import copysign, exp, sin, sqrt

import numpy as np

from bench.example_systems import Array, compare
from bench.function_machines import MACHINES, columns, held, requirements, switch, whole
from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.problem.problem import Problem


def battery(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A battery whose current is limited from 45 to 38 °C, and that is only charged once it is empty."""
    charge, temperature = 0.5, 20.0
    mode = limitations = 0
    ambient = inputs["ambient"].tolist()
    rows: list[tuple[float, ...]] = []
    for k, wanted in enumerate(inputs["current"].tolist()):
        if mode == 0 and temperature > 45:
            mode = 1
            limitations += 1
        elif mode == 1 and temperature < 38:
            mode = 0
        if charge < 0.1:
            mode = 2
        current = wanted
        if mode == 1:
            current = wanted * 0.4
        elif mode == 2:
            current = min(wanted, 0)
        if mode == 2 and charge > 0.3:
            mode = 0
        charge = min(1, max(0, charge - current / 30000 * 2))
        temperature += 2 * (0.00008 * current * current * (1.6 - charge) - 0.02 * (temperature - ambient[k]))
        rows.append((charge, temperature, mode, limitations))
    return columns(rows, "soc", "temp", "mode", "derates")


def tanks(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Two filled tanks with a pipe between them; the second has a drain, and an alarm from 5 down to 3 m."""
    first, second = 2.0, 1.0
    alarm = 0
    drains = whole(inputs["drain"])
    fills = inputs["fill2"].tolist()
    rows: list[tuple[float, ...]] = []
    for k, fill in enumerate(inputs["fill1"].tolist()):
        pipe = 0.55 * copysign(sqrt(abs(first - second)), first - second)
        outflow = (0.25 + 0.5 * drains[k]) * sqrt(second) * 0.6
        first = min(8, max(0, first + 0.12 * fill - 0.35 * pipe))
        second = min(8, max(0, second + 0.06 * fills[k] + 0.35 * pipe - outflow))
        if second > 5:
            alarm = 1
        elif second < 3:
            alarm = 0
        rows.append((first, second, alarm))
    return columns(rows, "level1", "level2", "alarm")


def drone(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A drone that holds an altitude in gusts, with limits of its thrust and of the controller's integral."""
    altitude, speed, integral = 10.0, 0.0, 0.0
    references = inputs["reference"].tolist()
    rows: list[tuple[float, ...]] = []
    for k, gust in enumerate(inputs["gust"].tolist()):
        error = references[k] - altitude
        integral = min(5, max(-5, integral + 0.1 * error * 0.15))
        thrust = min(20, max(0, 9.8 + 1.6 * error + integral - 2.2 * speed))
        speed += 0.1 * (thrust - 9.8 - 0.1 * (speed - gust) * abs(speed - gust) * 0.6)
        altitude += 0.1 * speed
        if altitude < 0:
            altitude = 0.0
            speed = max(speed, 0.0)
        rows.append((altitude, thrust, speed))
    return columns(rows, "altitude", "thrust", "speed")


def valley(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Rosenbrock's function of six parameters, with a tenth of its usual slope across the valley."""
    place = [parameters[f"place{j}"] for j in range(6)]
    height = sum(100 * (place[j + 1] - place[j] ** 2) ** 2 * 0.1 + (1 - place[j]) ** 2 for j in range(5))
    return {"height": np.full(len(times), height)}


def peak(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A narrow peak over two of twelve parameters, with ripples along a third."""
    height = exp(-30 * (parameters["place3"] - 0.37) ** 2) * exp(-30 * (parameters["place8"] - 0.71) ** 2)
    return {"height": np.full(len(times), height + 0.05 * sin(9 * parameters["place1"]))}


def mixture(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A slope with edges, and a count of parameters that are right; four of the seven are whole numbers."""
    count = [parameters[f"count{j}"] for j in range(4)]
    share = [parameters[f"share{j}"] for j in range(3)]
    counts_height = 20 - abs(count[0] - 13) - 0.7 * abs(count[1] - 4) - 0.5 * abs(count[2] - count[3])
    height = counts_height - 4 * abs(share[0] - 0.5 * share[1])
    right = [abs(value - best) <= 2 for value, best in zip(count, (3, 17, 9, 12), strict=True)]
    matches = float(sum(right) + (share[2] > 0.8))
    return {"height": np.full(len(times), height), "matches": np.full(len(times), matches)}


def glucose(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Glucose of the blood after meals and insulin, which acts with a delay."""
    sugar, insulin, action, stomach = 110.0, 10.0, 0.0, 0.0
    doses = inputs["insulin"].tolist()
    rows: list[tuple[float, ...]] = []
    for k, meal in enumerate(inputs["meal"].tolist()):
        stomach += 2 * (0.3 * meal - 0.03 * stomach)
        insulin += 2 * (doses[k] * 2 + 0.02 * max(sugar - 110, 0) - 0.1 * insulin)
        action += 2 * (0.0004 * max(insulin - 10, 0) - 0.02 * action)
        sugar = max(10.0, sugar + 2 * (-0.01 * (sugar - 110) - action * sugar * 0.2 + 0.12 * stomach))
        rows.append((sugar, insulin))
    return columns(rows, "sugar", "plasma")


def coupled(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Two lags of eight inputs, of which three do nothing and others are multiplied."""
    left = right = drive = 0.0
    inputs_at = zip(*(inputs[f"force{j}"].tolist() for j in range(8)), strict=True)
    rows: list[tuple[float, ...]] = []
    for force in inputs_at:
        wanted = 0.8 * force[1] + 0.9 * force[4] - 0.5 * force[6]
        drive += 0.1 * (wanted - drive)
        left += 0.1 * (drive - 0.4 * left + 0.15 * left * force[2])
        right += 0.1 * (force[5] + 0.5 * force[6] * force[1] - 0.3 * right)
        rows.append((left, right))
    return columns(rows, "left", "right")


def antilock(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A braked wheel that is released from a slip of 0.3 until one of 0.08."""
    speed = wheel = 30.0
    releases, released = 0, False
    frictions = inputs["friction"].tolist()
    rows: list[tuple[float, ...]] = []
    for k, brake in enumerate(inputs["brake"].tolist()):
        slip = max(0, (speed - wheel) / max(speed, 0.5))
        force = frictions[k] * 9.8 * (2 * slip * 0.15 / (slip * slip + 0.15**2))
        if slip > 0.3 and not released and speed > 2:
            released = True
            releases += 1
        elif slip < 0.08:
            released = False
        torque = brake * 18 * (0.55 if released else 1)
        speed = max(0, speed - 0.01 * force)
        wheel = min(speed, max(0, wheel + 0.01 * (force - torque) * 4))
        rows.append((speed, slip, releases))
    return columns(rows, "speed", "slip", "releases")


PROBLEMS: dict[str, Callable[[], Problem]] = {
    **MACHINES,
    **requirements(
        battery,
        {
            "battery temperature": "G (temp <= 46)",
            "battery third limitation": "G (derates <= 2.5)",
            "battery long limitation": "G[0,500] (mode >= 0.5 -> F[0,100] (mode <= 0.5 or temp <= 40))",
        },
        {"soc": "real", "temp": "real", "mode": "integer", "derates": "integer"},
        inputs=(
            held("current", -50, 100, 12),
            InputRange("ambient", -10, 40, control_points=4, interpolation="linear"),
        ),
        stop=600.0,
        interval=2.0,
    ),
    **requirements(
        tanks,
        {
            "tanks second level": "G (level2 <= 7.4)",
            "tanks long alarm": "G[0,120] (alarm >= 0.5 -> F[0,80] (level2 <= 3))",
            "tanks second follows": "G[0,150] (level1 >= 7.5 -> F[0,30] (level2 >= 2))",
        },
        {"level1": "real", "level2": "real", "alarm": "integer"},
        inputs=(held("fill1", 0, 5, 10), held("fill2", 0, 5, 10), switch("drain", 15)),
        stop=200.0,
        interval=1.0,
    ),
    **requirements(
        drone,
        {
            "drone speed": "G[5,40] (speed <= 13)",
            "drone altitude": "G[2,40] (altitude <= 43.5)",
            "drone long thrust": "G[0,36] (thrust >= 19.9 -> F[0,4] (thrust <= 18))",
        },
        {"altitude": "real", "thrust": "real", "speed": "real"},
        inputs=(
            InputRange("gust", -10, 10, control_points=12, interpolation="pchip"),
            held("reference", 5, 40, 5),
        ),
        stop=40.0,
        interval=0.1,
    ),
    **requirements(
        valley,
        {"valley easy": "G (height >= 40)", "valley hard": "G (height >= 14)"},
        {"height": "real"},
        parameters=tuple(ParameterRange(f"place{j}", -2.0, 2.0) for j in range(6)),
        stop=1.0,
        interval=0.1,
    ),
    **requirements(
        peak,
        {"peak easy": "G (height <= 0.8)", "peak hard": "G (height <= 0.93)"},
        {"height": "real"},
        parameters=tuple(ParameterRange(f"place{j}", 0.0, 1.0) for j in range(12)),
        stop=1.0,
        interval=0.1,
    ),
    **requirements(
        mixture,
        {
            "mixture easy": "G (height <= 12)",
            "mixture hard": "G (height <= 16.5)",
            "mixture matches": "G (matches <= 3.5)",
        },
        {"height": "real", "matches": "real"},
        parameters=(
            *(ParameterRange(f"count{j}", 0, 20, kind="integer") for j in range(4)),
            *(ParameterRange(f"share{j}", 0.0, 1.0) for j in range(3)),
        ),
        stop=1.0,
        interval=0.1,
    ),
    **requirements(
        glucose,
        {
            "glucose high": "G (sugar <= 250)",
            "glucose high, then not low": "G[60,380] (sugar <= 190 or F[0,100] (sugar <= 90))",
            "glucose high for long": "G[0,360] (sugar >= 180 -> F[0,120] (sugar <= 120))",
        },
        {"sugar": "real", "plasma": "real"},
        inputs=(held("meal", 0, 10, 8), held("insulin", 0, 4, 8)),
        stop=480.0,
        interval=2.0,
    ),
    **requirements(
        coupled,
        {"coupled left": "G (left <= 2.6)", "coupled left and right": "G (left <= 2.3 or right >= -1)"},
        {"left": "real", "right": "real"},
        inputs=tuple(
            InputRange(f"force{j}", -1, 1, control_points=4, interpolation="linear") for j in range(8)
        ),
        stop=20.0,
        interval=0.1,
    ),
    **requirements(
        antilock,
        {"antilock fifth release": "G (releases <= 4.5)"},
        {"speed": "real", "slip": "real", "releases": "integer"},
        inputs=(held("brake", 0, 1, 10), held("friction", 0.1, 1, 6)),
        stop=8.0,
        interval=0.01,
    ),
}


if __name__ == "__main__":
    compare(PROBLEMS, __doc__)
