"""Draws docs/templates.png: each template of docs/requirements.md, satisfied and violated.

python docs/scripts/template_pictures.py
"""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.problem.spec import parse_spec
from falsifier.stl import Monitor, parse

DOCS = Path(__file__).resolve().parents[1]
STOP, STEP = 10.0, 0.01
TIMES = np.linspace(0.0, STOP, 1001)
Columns = Mapping[str, NDArray[np.float64]]


def _step(at: float, low: float, high: float) -> NDArray[np.float64]:
    steps: NDArray[np.float64] = np.where(at <= TIMES, high, low)
    return steps


def _pulse(start: float, end: float) -> NDArray[np.float64]:
    return _step(start, 0.0, 1.0) - _step(end, 0.0, 1.0)


def _second_order(damping: float, frequency: float, *, at: float = 0.0) -> NDArray[np.float64]:
    """Response of a second-order system to a step from 0 to 1."""
    t = np.maximum(TIMES - at, 0.0)
    wd = frequency * np.sqrt(1 - damping**2)
    decay = np.exp(-damping * frequency * t)
    return np.asarray(1 - decay * (np.cos(wd * t) + damping * frequency / wd * np.sin(wd * t)))


_TARGET = _step(2.0, 20.0, 80.0)
# By template: what satisfies it and what violates it, and what is drawn in grey.
EXAMPLES: Mapping[str, tuple[Columns, Columns, Columns]] = {
    "settles": (
        {"speed": 20 + 60 * _second_order(0.6, 2.5, at=2), "target": _TARGET},
        {"speed": 20 + 60 * _second_order(0.1, 2.5, at=2), "target": _TARGET},
        {"target": _TARGET},
    ),
    "overshoot": (
        {"speed": 80 * _second_order(0.8, 2.0)},
        {"speed": 80 * _second_order(0.35, 2.0)},
        {"limit": np.full(TIMES.shape, 84.0)},
    ),
    "rise": (
        {"speed": 80 * _second_order(0.8, 1.2)},
        {"speed": 80 * _second_order(0.9, 0.6)},
        {"level": np.full(TIMES.shape, 72.0)},
    ),
    "response": (
        {"pedal": _pulse(2, 6), "light": 1.2 * _pulse(2.5, 8)},
        {"pedal": _pulse(2, 6), "light": 1.2 * _pulse(4, 8)},
        {"pedal": _pulse(2, 6)},
    ),
    "stays_within": (
        {"front": 0.4 * np.sin(TIMES), "rear": np.zeros(TIMES.shape)},
        {"front": 0.08 * TIMES * np.sin(TIMES), "rear": np.zeros(TIMES.shape)},
        {"low": np.full(TIMES.shape, -0.5), "high": np.full(TIMES.shape, 0.5)},
    ),
    "never_together": (
        {"heating": _pulse(5, 8), "cooling": 0.9 * _pulse(1, 4.5)},
        {"heating": _pulse(3, 8), "cooling": 0.9 * _pulse(1, 4.5)},
        {"cooling": 0.9 * _pulse(1, 4.5)},
    ),
    "dwell": (
        {"gear": _step(1, 1, 2) + _step(3, 0, 1) - _step(6, 0, 1)},
        {"gear": _step(1, 1, 2) + _step(3, 0, 1) - _step(4, 0, 1)},
        {"third": np.full(TIMES.shape, 3.0)},
    ),
    "ramp_limit": (
        {"valve": np.clip(0.3 * (TIMES - 2), 0, 1)},
        {"valve": np.clip(2.0 * (TIMES - 2), 0, 1)},
        {"limit": np.clip(0.5 * (TIMES - 2), 0, 1)},
    ),
    "order": (
        {"unlocked": _pulse(2, 9), "running": 0.9 * _pulse(4, 8)},
        {"unlocked": _pulse(5, 9), "running": 0.9 * _pulse(4, 8)},
        {"running": 0.9 * _pulse(4, 8)},
    ),
}


def robustness() -> dict[str, tuple[float, float]]:
    """Return the robustness of what satisfies and of what violates each template of the page."""
    page = (DOCS / "requirements.md").read_text(encoding="utf-8")
    block = re.search(r"^```toml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert block is not None
    spec = parse_spec(tomllib.loads(block[1]), file="requirements.md")
    found = {}
    for name, section in spec.requirements.items():
        monitor = Monitor(parse(section.expanded(STOP, STEP)), STEP, len(TIMES))
        good, bad = (monitor.evaluate(Trajectory(TIMES, dict(c))).robustness for c in EXAMPLES[name][:2])
        found[name] = (good, bad)
    return found


def draw(file: Path) -> None:
    """Draw all templates into one picture."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(3, 3, figsize=(9.6, 5.6), sharex=True, layout="constrained")
    for axis, (name, (good, bad)) in zip(axes.flat, robustness().items(), strict=True):
        satisfied, violated, grey = EXAMPLES[name]
        for column in grey.values():
            axis.plot(TIMES, column, color="0.6", linestyle="--", linewidth=1)
        for columns, color in ((satisfied, "tab:blue"), (violated, "tab:red")):
            shown = next(n for n in columns if n not in grey)
            axis.plot(TIMES, columns[shown], color=color, linewidth=1.5)
        axis.set_title(f"{name}  (robustness {good:+.3g}, {bad:+.3g})", fontsize=9)
        axis.tick_params(labelsize=7)
    for axis in axes[-1]:
        axis.set_xlabel("time in s", fontsize=8)
    figure.savefig(file, dpi=110)


if __name__ == "__main__":
    print(robustness())
    draw(DOCS / "templates.png")
