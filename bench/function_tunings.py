"""Which engine finds the violations of two systems that are tuned by numbers?

``python -m bench.function_tunings`` prints the table of ``bench/example_systems.py`` for four requirements
that join conditions. They were written after the engine, which was not changed after the first look at them.
"""

from collections.abc import Mapping
from math import cos, exp, hypot, sin

from bench.example_systems import Array, compare
from bench.function_machines import columns, requirements
from falsifier.core.ranges import ParameterRange

RANGES = {
    "thrown": {
        "speed": (20.0, 60.0), "angle": (0.2, 1.3), "mass": (0.2, 2.0), "drag": (0.0005, 0.01),
        "wind": (-8.0, 8.0), "gust": (0.0, 6.0), "lift": (-0.02, 0.02), "height": (0.5, 10.0),
        "decay": (0.0, 0.4),
    },
    "regulated": {
        "gain": (0.2, 8.0), "integral": (0.0, 4.0), "derivative": (0.0, 1.0), "filter": (0.02, 0.5),
        "lag": (0.2, 2.0), "sensor": (0.02, 0.6), "friction": (0.0, 0.3), "limit": (1.0, 5.0),
        "load": (-1.0, 1.0), "step": (0.2, 1.5),
    },
}  # fmt: skip


def thrown(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A spinning ball in wind that dies down: distance, height and speed, kept from where it lands."""
    p, step = parameters, float(times[1] - times[0])
    x, y = 0.0, p["height"]
    vx, vy = p["speed"] * cos(p["angle"]), p["speed"] * sin(p["angle"])
    rows: list[tuple[float, ...]] = []
    for t in times.tolist():
        air = vx - (p["wind"] + p["gust"] * sin(2.0 * t)) * exp(-p["decay"] * t)
        speed = hypot(air, vy)
        rows.append((x, y, hypot(vx, vy)))
        if y > 0.0:
            pull = p["drag"] * speed / p["mass"]
            turn = p["lift"] * speed / p["mass"]
            ax, ay = -pull * air - turn * vy, -9.81 - pull * vy + turn * air
            x, y, vx, vy = x + step * vx, max(0.0, y + step * vy), vx + step * ax, vy + step * ay
    return columns(rows, "distance", "height", "speed")


def regulated(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """A plant with friction under a controller with a slow sensor and a limited output: value and effort."""
    p, step = parameters, float(times[1] - times[0])
    value = rate = seen = slope = total = 0.0
    rows: list[tuple[float, ...]] = []
    for t in times.tolist():
        error = p["step"] - seen
        new = (error - slope) / p["filter"]
        slope += step * new
        effort = p["gain"] * (error + p["integral"] * total + p["derivative"] * new)
        cut = min(max(effort, -p["limit"]), p["limit"])
        if cut == effort:
            total += step * error
        drag = p["friction"] * (1.0 if rate > 0.0 else -1.0)
        rate += step * (cut + (p["load"] if t > 6.0 else 0.0) - rate - drag) / p["lag"]
        value += step * rate
        seen += step * (value - seen) / p["sensor"]
        rows.append((value - p["step"], cut))
    return columns(rows, "error", "effort")


SEARCHED = {
    name: tuple(ParameterRange(key, low, high) for key, (low, high) in ranges.items())
    for name, ranges in RANGES.items()
}
PROBLEMS = {
    **requirements(
        thrown,
        {
            "thrown far but low": "G (distance <= 210) or F (height >= 18)",
            "thrown far, high and slow": "G (distance <= 170) or G (height <= 70) or G[12,12] (speed >= 28)",
        },
        {"distance": "real", "height": "real", "speed": "real"},
        parameters=SEARCHED["thrown"],
        stop=12.0,
        interval=0.02,
    ),
    **requirements(
        regulated,
        {
            "regulated overshoot that settles": "G (error <= 0.8) or F[5,6] (abs(error) >= 0.03)",
            "regulated overshoot with little effort": "G (error <= 1) or F[5,6] (abs(error) >= 0.1) or "
            "F (effort >= 1.5) or G[9,12] (abs(error) <= 0.2)",
        },
        {"error": "real", "effort": "real"},
        parameters=SEARCHED["regulated"],
        stop=12.0,
        interval=0.01,
    ),
}


if __name__ == "__main__":
    compare(PROBLEMS, __doc__)
