"""What Wine costs a simulation, and how far its trajectories are from those of the library for Linux.

``python -m bench.wine [--rounds N] [--out bench/wine.md]``

Simulates each bundled FMU by turns with its library for Linux and, through Wine, with the one for Windows:
each interface up to the stop time of its default experiment, at its step, with inputs that are new in each
round; FMUs that fail with such inputs are left out. Then the start of a process, up to the end of its first
simulation. Needs Wine.
"""

import argparse
import os
import platform
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from falsifier.core.experiment import Experiment
from falsifier.core.model import Interface
from falsifier.core.signals import Interpolation, Signal
from falsifier.core.trajectory import Trajectory
from falsifier.errors import SimulationError
from falsifier.fmu import FmuModel, read_info
from falsifier.fmu.description import libraries

HERE = Path(__file__).parent
FMUS = HERE.parent / "fmus"
SAMPLES = 5000
STARTS = 10


def inputs(model: FmuModel, stop: float, random: np.random.Generator) -> dict[str, Signal]:
    """Return an input signal with 7 control points for each input, within its range."""
    signals = {}
    for variable in model.info.inputs:
        low, high = variable.limits
        low, high = (0.0 if low is None else low), (1.0 if high is None else high)
        values = (low + (high - low) * random.random(7)).tolist()
        kind: Interpolation = "pchip" if variable.kind == "real" else "constant"
        signals[variable.name] = Signal.evenly(values, stop_time=stop, interpolation=kind)
    return signals


def timed(model: FmuModel, signals: dict[str, Signal], experiment: Experiment) -> tuple[Trajectory, float]:
    """Simulate; return the trajectory and the time that it took in ms."""
    started = time.perf_counter()
    trajectory = model.simulate(signals, {}, experiment)
    return trajectory, 1e3 * (time.perf_counter() - started)


def apart(one: Trajectory, other: Trajectory) -> float:
    """Return the largest difference, relative to the largest value of each variable."""
    return max(float(np.abs(one[n] - other[n]).max() / max(np.abs(other[n]).max(), 1e-9)) for n in one.names)


def last_digit(signals: dict[str, Signal]) -> dict[str, Signal]:
    """Return the signals with values that differ in the last digit."""
    return {n: replace(s, values=tuple(np.nextafter(s.values, np.inf).tolist())) for n, s in signals.items()}


def measure(path: Path, interface: Interface, rounds: int) -> tuple[NDArray[np.float64], float, float]:
    """Return the times in ms, shape (rounds, 2), and two largest differences of trajectories.

    The first one is between the libraries; the second one between the library for Linux and itself, with
    inputs that differ in the last digit.
    """
    models = [FmuModel(path, interface, windows=windows) for windows in (False, True)]
    info = models[0].info
    stop = info.stop_time or 10.0
    experiment = Experiment(stop, stop / SAMPLES, tuple(v.name for v in info.outputs))
    random = np.random.default_rng(1)
    times, between, within = [], 0.0, 0.0
    for k in range(rounds + 2):
        signals = inputs(models[0], stop, random)
        done = [timed(model, signals, experiment) for model in models]
        between = max(between, apart(done[1][0], done[0][0]))
        moved, _ = timed(models[0], last_digit(signals), experiment)
        within = max(within, apart(moved, done[0][0]))
        if k >= 2:  # the first ones load the libraries and test how instances start again
            times.append([taken for _, taken in done])
    for model in models:
        model.close()
    return np.array(times), between, within


def first_simulation(*, windows: bool) -> float:
    """Return the median time in ms of a new process's first simulation of AT, of 10 steps."""
    taken = []
    for _ in range(STARTS):
        model = FmuModel(FMUS / "AT.fmu", windows=windows)
        experiment = Experiment(0.1, 0.01, ("speed",))
        taken.append(timed(model, {}, experiment)[1])
        model.close()
    return float(np.median(taken))


def report(rounds: int) -> str:
    """Return all results as Markdown."""
    found = libraries.find_wine()
    if found is None:
        raise SystemExit(f"Wine is missing: {libraries.HOW_TO_INSTALL}")
    version = subprocess.run([found, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    lines = [
        "# What Wine costs a simulation",
        "",
        f"`python -m bench.wine --rounds {rounds}`; {platform.machine()}, {os.cpu_count()} cores, load "
        f"{os.getloadavg()[0]:.1f} before the start, Python {platform.python_version()}, {version}. Times in "
        f"ms: minimum (median) of interleaved rounds of {SAMPLES} steps; ratio of minima (median of the "
        "ratios).",
        "",
        "Between: largest difference of the trajectories of the two libraries, relative to the largest value "
        "of the variable. Within: the same between two trajectories of the library for Linux, with inputs "
        "that differ in the last digit.",
        "",
        "| FMU | interface | library for Linux | through Wine | Wine / Linux | between | within |",
        "|---|---|---|---|---|---|---|",
    ]
    for path in sorted(FMUS.glob("*.fmu")):
        for interface in read_info(path).interfaces:
            try:
                times, between, within = measure(path, interface, rounds)
            except SimulationError as error:
                print(f"{path.stem}, {interface}: left out: {error}", file=sys.stderr)
                continue
            low, middle = times.min(axis=0), np.median(times, axis=0)
            ratio = float(np.median(times[:, 1] / times[:, 0]))
            cells = [f"{low[k]:.2f} ({middle[k]:.2f})" for k in (0, 1)]
            cells += [f"{low[1] / low[0]:.2f} ({ratio:.2f})", f"{between:.1g}", f"{within:.1g}"]
            lines.append(f"| {path.stem} | {interface} | {' | '.join(cells)} |")
            print(lines[-1], flush=True)
    first_simulation(windows=False)
    native, through_wine = (first_simulation(windows=windows) for windows in (False, True))
    lines += [
        "",
        f"The first simulation of a new process takes {native:.0f} ms with the library for Linux and "
        f"{through_wine:.0f} ms through Wine (AT, 10 steps; medians of {STARTS}).",
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--out", type=Path, default=HERE / "wine.md")
    options = parser.parse_args()
    text = report(options.rounds)
    options.out.write_text(text, encoding="utf-8")
    print(text)
