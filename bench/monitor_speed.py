"""How long does one robustness value take, here and in other monitors?

Four formulas on trajectories of 501, 5001 and 50001 samples over 100 s. Each round runs every monitor on the
same smooth trajectory, fast ones in blocks. The table shows the processor time of the best round, because
other processes can only increase it; garbage collection is off. Formulas are parsed and compiled beforehand;
``here`` is the complete call from a trajectory to a verdict with robustness, critical time, predicate and
values. rtamt gets the samples as lists, which it processes faster than arrays. stlrom has to load the
samples, so its time is that of loading and evaluating, with the evaluation alone in parentheses. Monitors
that are not installed are omitted, and so are evaluations that would take minutes.

    python bench/monitor_speed.py > bench/monitor_speed.md
"""

import argparse
import contextlib
import gc
import platform
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.stl import Monitor, parse

LENGTHS = (501, 5001, 50_001)
FORMULAS = {
    "phi1": "G[0,20] (speed <= 120)",
    "phi2": "(G[0,30] (rpm <= 3000)) -> (G[0,4] (speed <= 35))",
    "phi3": "G[0,65] F[0,30] G[0,5] (x >= 8)",
    "phi4": "(speed >= 10) U[5,30] (rpm >= 3400)",
}
RTAMT = {
    "phi1": "(always[{0},{20}] (speed <= 120))",
    "phi2": "((always[{0},{30}] (rpm <= 3000)) -> (always[{0},{4}] (speed <= 35)))",
    "phi3": "(always[{0},{65}] (eventually[{0},{30}] (always[{0},{5}] (x >= 8))))",
    "phi4": "((speed >= 10) until[{5},{30}] (rpm >= 3400))",
}
STLROM = {
    "phi1": "alw_[0,20] (speed[t] <= 120)",
    "phi2": "(alw_[0,30] (rpm[t] <= 3000)) => (alw_[0,4] (speed[t] <= 35))",
    "phi3": "alw_[0,65] (ev_[0,30] (alw_[0,5] (x[t] >= 8)))",
    "phi4": "(speed[t] >= 10) until_[5,30] (rpm[t] >= 3400)",
}
TOO_SLOW = {("phi4", 5001), *((name, 50_001) for name in ("phi2", "phi3", "phi4"))}  # rtamt, discrete
AT6 = " and ".join(
    f"((G[0,30] (rpm <= 3000)) -> (G[0,{end}] (speed <= {bound})))"
    for end, bound in ((4, 35), (8, 50), (20, 65))
)

Call = Callable[[], float]


def smooth(samples: int) -> Trajectory:
    """Return a trajectory of 100 s that exercises most windows of all four formulas."""
    t = np.linspace(0.0, 100.0, samples)
    columns = {
        "speed": 60 + 50 * np.sin(t / 9) + 10 * np.sin(t / 1.3),
        "rpm": 2900 + 900 * np.sin(t / 11) + 500 * np.cos(t / 2.1),
        "x": 10 + 9 * np.sin(t / 4) + np.cos(3 * t),
    }
    return Trajectory(t, columns)


def here(name: str, t: Trajectory) -> Call:
    """Return a call of our monitor, which computes a complete verdict."""
    monitor = Monitor(parse(FORMULAS[name]), 100.0 / (len(t) - 1), len(t))
    return lambda: monitor.evaluate(t).robustness


def rtamt_discrete(name: str, t: Trajectory) -> Call | None:
    """Return a call of rtamt in discrete time, counted in samples of one second; None if it is too slow."""
    if (name, len(t)) in TOO_SLOW:
        return None
    per_second = (len(t) - 1) // 100
    specification = _rtamt().StlDiscreteTimeOfflineSpecification()
    bounds = [str(second * per_second) for second in range(66)]
    _prepare(specification, t, RTAMT[name].format(*bounds))
    data = {"time": [float(k) for k in range(len(t))]}
    data.update({signal: column.tolist() for signal, column in t.columns.items()})
    return lambda: float(specification.evaluate(data)[0][1])


def rtamt_dense(name: str, t: Trajectory) -> Call:
    """Return a call of rtamt in dense time, in its default unit s."""
    specification = _rtamt().StlDenseTimeOfflineSpecification()
    _prepare(specification, t, RTAMT[name].format(*map(str, range(66))))
    times = t.times.tolist()
    data = [
        [signal, [list(pair) for pair in zip(times, column.tolist(), strict=True)]]
        for signal, column in t.columns.items()
    ]
    return lambda: float(specification.evaluate(*data)[0][1])


def stlrom(name: str, t: Trajectory, *, load: bool) -> Call:
    """Return a call of stlrom, Breach's monitor, in dense time, with values held between samples."""
    from stlrom import STLDriver  # type: ignore[import-not-found,unused-ignore]

    driver = STLDriver()
    driver.parse_string(f"signal speed, rpm, x\n{name} := {STLROM[name]}\n")
    rows = np.stack([t.times, t["speed"], t["rpm"], t["x"]], axis=1).tolist()
    driver.set_interpol("PREVIOUS")
    driver.data = rows

    def loaded() -> float:
        driver.data = rows
        return float(driver.get_monitor(name).eval_rob())

    monitor = driver.get_monitor(name)
    return loaded if load else lambda: float(monitor.eval_rob())


def installed(module: str) -> bool:
    """Whether another monitor can be imported."""
    with contextlib.suppress(ImportError):
        __import__(module)
        return True
    return False


def _rtamt() -> Any:
    from falsifier.stl.second_monitor import _rtamt as imported

    return imported()


def _prepare(specification: Any, t: Trajectory, text: str) -> None:
    for signal in t.names:
        specification.declare_var(signal, "float")
    specification.spec = text
    specification.parse()


def measure(calls: dict[str, Call], rounds: int = 15) -> dict[str, float]:
    """Return the time in s of each call in its best round; they run in turn, slow ones in fewer rounds."""
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    gc.collect()
    gc.disable()
    for number in range(rounds):
        for name, call in calls.items():
            spent = sum(seconds[name])
            if number == 0 or spent < 3.0:
                seconds[name].append(_seconds(call))
    gc.enable()
    return {name: min(times) for name, times in seconds.items()}


def _seconds(call: Call) -> float:
    """Return the mean processor time in s of a call in a block of about 5 ms."""
    started = time.process_time()
    call()
    once = time.process_time() - started
    repeats = min(200, int(0.005 / max(once, 1e-6)))
    started = time.process_time()
    for _ in range(repeats):
        call()
    return (time.process_time() - started) / repeats if repeats else once


def rows() -> Iterator[str]:
    """Yield the rows of the table for single trajectories."""
    has_stlrom = installed("stlrom")
    for samples in LENGTHS:
        t = smooth(samples)
        for name in FORMULAS:
            calls: dict[str, Call] = {"here": here(name, t), "dense": rtamt_dense(name, t)}
            if (discrete := rtamt_discrete(name, t)) is not None:
                calls["discrete"] = discrete
            if has_stlrom:
                calls["stlrom"], calls["bare"] = stlrom(name, t, load=True), stlrom(name, t, load=False)
            values = {tool: call() for tool, call in calls.items()}
            agree = np.ptp(list(values.values())) <= 1e-9 * (1 + abs(values["here"]))
            found = measure(calls)
            cells = [f"{1e6 * found['here']:,.1f}"]
            cells += [_peer(found.get(tool), found["here"]) for tool in ("discrete", "dense", "stlrom")]
            bare = f" ({1e6 * found['bare']:,.0f})" if has_stlrom else ""
            print(samples, name, values, file=sys.stderr)
            yield f"| {samples} | {name} | " + " | ".join(cells) + f"{bare} | {'yes' if agree else 'NO'} |"


def _peer(seconds: float | None, ours: float) -> str:
    return "-" if seconds is None else f"{1e6 * seconds:,.0f} = {seconds / ours:,.0f} x"


def batch() -> str:
    """Return one line on the evaluation of many trajectories at once."""
    rng = np.random.default_rng(1)
    columns = {
        "speed": 40 + 15 * rng.standard_normal((1000, 101)),
        "rpm": 2800 + 90 * rng.standard_normal((1000, 101)),
    }
    monitor = Monitor(parse(AT6), 0.5, 101)
    found = measure({"batch": lambda: float(monitor.batch(columns)[0])})["batch"]
    return f"AT6abc on 1000 trajectories of 101 samples in one call: {1e3 * found:.2f} ms."


def main() -> None:
    """Print the tables."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter).parse_args()
    warnings.simplefilter("ignore")
    print("# Time of one robustness value\n")
    print("Processor time in microseconds; `x` is the multiple of the time here. Method: see")
    print("`bench/monitor_speed.py`. moonlight needs Java 21 and was not measured.\n")
    print(f"Machine: {platform.machine()}, Python {platform.python_version()}, 2 shared cores.\n")
    for name, text in FORMULAS.items():
        print(f"- {name} = `{text}`")
    print("\n| samples | formula | here | rtamt, discrete | rtamt, dense | stlrom, load + evaluate | equal |")
    print("|---|---|---|---|---|---|---|")
    for row in rows():
        print(row, flush=True)
    print(f"\n{batch()}")


if __name__ == "__main__":
    main()
