"""Overhead of a simulation over the FMU's own time.

``python -m bench.fmu_overhead [--rounds N] [--out bench/fmu_overhead.md]``

Simulates in turn with fmpy.simulate_fmu, FmuModel, which has a worker, and a C program that makes the same
calls (bench/fmu_loop.c, needs a C compiler). The FMUs do one Runge-Kutta step of one or two states per
communication step (tests/fixtures/fmus, Cheap*); if they have an input, it varies over time, with 7 control
points that are new for each simulation. Then 3000 simulations in a row, a crash, and a hang.
"""

import argparse
import os
import platform
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from falsifier.core.compiler import compiler
from falsifier.core.experiment import Experiment
from falsifier.core.signals import Signal
from falsifier.errors import SimulationError
from falsifier.fmu import FmuModel
from falsifier.fmu.description import archive
from falsifier.fmu.description.model_description import read_description
from tests.fmu.fixtures import runner

HERE = Path(__file__).parent
FMUS = HERE.parent / "tests" / "fixtures" / "fmus"
STOP = 10.0
CASES = [
    (name, steps)
    for name in ("CheapLag_2", "CheapLag_3", "CheapVanDerPol_2", "CheapVanDerPol_3")
    for steps in (1000, 5000)
]


class CProgram:
    """The C program, running for one FMU."""

    def __init__(
        self, folder: Path, path: Path, steps: int, inputs: list[str], outputs: tuple[str, ...]
    ) -> None:
        description = read_description(path)
        extracted = folder / path.stem
        archive.extract(path, extracted)
        identifier = description.identifiers["co-simulation"]
        platform = archive.this_platform()
        library = extracted / archive.library_file(description.info.fmi_version, identifier, platform)
        references = [str(description.slots[n].reference) for n in (*inputs, *outputs)]
        driven = references[: len(inputs)] or ["-1"]
        program = folder / "fmu_loop"
        if not program.exists():
            command = [*compiler(), "-O2", str(HERE / "fmu_loop.c"), "-o", str(program), "-ldl", "-lm"]
            subprocess.run(command, check=True)
        self._process = subprocess.Popen(
            [str(program), str(library), str(description.major), description.token, str(steps),
             str(STOP / steps),
             *driven, *references[len(inputs) :]],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1,
        )  # fmt: skip

    def __call__(self) -> float:
        """Simulate once; return the time in microseconds, measured by the program."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write("\n")
        return float(self._process.stdout.readline())

    def close(self) -> None:
        """End the program."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def timed(action: Callable[[], object]) -> float:
    """Return the time of one call in microseconds."""
    started = time.perf_counter()
    action()
    return 1e6 * (time.perf_counter() - started)


def measure(name: str, steps: int, rounds: int, folder: Path) -> dict[str, NDArray[np.float64]]:
    """Return the times in microseconds by kind of simulation, shape (rounds,) each."""
    from fmpy import simulate_fmu

    path = FMUS / f"{name}.fmu"
    apart = FmuModel(path)
    inputs = [v.name for v in apart.info.inputs]
    outputs = tuple(v.name for v in apart.info.outputs)
    experiment = Experiment(STOP, STOP / steps, outputs)
    program = CProgram(folder, path, steps, inputs, outputs)
    random = np.random.default_rng(1)
    grid = np.linspace(0.0, STOP, 21)

    def signals() -> dict[str, Signal]:
        return {n: Signal.evenly(random.uniform(-1, 1, 7).tolist(), stop_time=STOP) for n in inputs}

    def simulated(model: FmuModel) -> float:
        chosen = signals()
        return timed(lambda: model.simulate(chosen, {}, experiment))

    def fmpy() -> object:
        columns = [("time", np.float64), *((n, np.float64) for n in inputs)]
        rows = zip(grid, *(s.sample(grid) for s in signals().values()), strict=True)
        table = np.array([tuple(map(float, row)) for row in rows], dtype=columns) if inputs else None
        return simulate_fmu(
            str(path), stop_time=STOP, output_interval=STOP / steps, input=table, output=list(outputs),
            fmi_type="CoSimulation",
        )  # fmt: skip

    kinds: dict[str, Callable[[], float]] = {
        "c": program,
        "worker": lambda: simulated(apart),
        "fmpy": lambda: timed(fmpy),
    }
    for action in kinds.values():
        action()
        action()
    taken: dict[str, list[float]] = {kind: [] for kind in kinds}
    for k in range(rounds):
        for kind, action in kinds.items():
            # fmpy takes a hundred times as long, so it runs only in every tenth round.
            if kind != "fmpy" or k % 10 == 0:
                action()  # warms the caches after the other kinds
                taken[kind].append(action())
    program.close()
    apart.close()
    return {kind: np.array(times) for kind, times in taken.items()}


def memory_kib(pid: int) -> int:
    """Return the resident memory of a process in KiB."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    return int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS")))


def descriptors() -> int:
    """Return the number of open files of this process."""
    return len(os.listdir("/proc/self/fd"))  # noqa: PTH208 (counts names, needs no paths)


def endurance(count: int) -> str:
    """Return a table of memory and open files before and after many simulations in a row."""
    lines = []
    for name in ("CheapLag_2", "NoReset_2"):
        model = FmuModel(FMUS / f"{name}.fmu")
        experiment = Experiment(1.0, 0.01, ("y",))
        for _ in range(300):
            model.simulate({}, {}, experiment)
        fmu = runner(model)
        first = fmu._worker.program.pid if fmu._worker else 0
        before = memory_kib(os.getpid()), memory_kib(first) if first else 0, descriptors()
        for _ in range(count):
            model.simulate({}, {}, experiment)
        last = fmu._worker.program.pid if fmu._worker else 0
        after = memory_kib(os.getpid()), memory_kib(last) if last else 0, descriptors()
        lines.append(
            f"| {name} | {before[0]} -> {after[0]} | {before[1]} -> {after[1]}"
            f"{'' if first == last else ' (another worker)'} | {before[2]} -> {after[2]} |"
        )
        model.close()
    return "\n".join(lines)


def failure(misdeed: int, limit: float) -> tuple[float, float]:
    """Return the median time in ms until a crash or hang is reported, and that of the next simulation."""
    model = FmuModel(FMUS / "Misdeeds_2.fmu")
    experiment = Experiment(1.0, 0.1, ("y",), time_limit=limit)
    noticed, recovered = [], []
    for _ in range(20):
        model.simulate({}, {}, experiment)
        started = time.perf_counter()
        try:
            model.simulate({}, {"misdeed": misdeed}, experiment)
        except SimulationError:
            noticed.append(1e3 * (time.perf_counter() - started))
        recovered.append(1e-3 * timed(lambda: model.simulate({}, {}, experiment)))
    model.close()
    return float(np.median(noticed)), float(np.median(recovered))


def report(rounds: int) -> str:
    """Return all results as Markdown."""
    load = os.getloadavg()[0]
    lines = [
        "# Overhead of a simulation over the FMU's own time",
        "",
        f"`python -m bench.fmu_overhead --rounds {rounds}`; {platform.machine()}, {os.cpu_count()} cores, "
        f"load {load:.1f} before the start, Python {platform.python_version()}. Times in microseconds: "
        "minimum (median) of interleaved rounds; ratio of minima (of medians); difference of minima (median "
        "of the differences).",
        "",
        "| FMU, steps | C program | in a worker | fmpy.simulate_fmu | fmpy / worker | worker - C |",
        "|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for name, steps in CASES:
            t = measure(name, steps, rounds, Path(folder))
            low = {kind: float(times.min()) for kind, times in t.items()}
            mid = {kind: float(np.median(times)) for kind, times in t.items()}
            cells = [f"{low[kind]:.0f} ({mid[kind]:.0f})" for kind in ("c", "worker", "fmpy")]
            apart = float(np.median(t["worker"] - t["c"]))
            lines.append(
                f"| {name}, {steps} | {' | '.join(cells)} | {low['fmpy'] / low['worker']:.0f} "
                f"({mid['fmpy'] / mid['worker']:.0f}) | {low['worker'] - low['c']:.0f} ({apart:.0f}) |"
            )
            print(lines[-1], flush=True)
    crash, hang = failure(1, 60.0), failure(2, 0.2)
    lines += [
        "",
        "3000 simulations in a row in a worker: resident memory in KiB and open files, before -> after.",
        "",
        "| FMU | parent | worker | open files |",
        "|---|---|---|---|",
        endurance(3000),
        "",
        f"A segmentation fault is reported after {crash[0]:.1f} ms; the next simulation takes {crash[1]:.1f} "
        f"ms. An endless loop with a time limit of 200 ms: {hang[0]:.0f} ms and {hang[1]:.1f} ms. Medians of "
        "20.",
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--out", type=Path, default=HERE / "fmu_overhead.md")
    options = parser.parse_args()
    text = report(options.rounds)
    options.out.write_text(text, encoding="utf-8")
    print(text)
