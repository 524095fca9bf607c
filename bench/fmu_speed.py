"""Time spent inside the bundled FMUs per simulation: set inputs, doStep, get outputs in a compiled loop.

Usage: python bench/fmu_speed.py [fmus/AT.fmu ...]; default: those of the benchmark.
FMUs must be of FMI 2.0 and have real inputs.
Prints the table; it needs numba (``pip install numba``). Committed result: bench/fmu_speed.md.
"""

from __future__ import annotations

import argparse
import ctypes
import platform
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

RUNS = 30
CONTROL_POINTS = 8
SYSTEMS = ("AT", "CC", "F16", "NN", "PM", "SC")
ROOT = Path(__file__).parent.parent


@dataclass(frozen=True)
class Row:
    """One line of the table: CPU times in ms."""

    name: str
    stop: float
    step: float
    inputs: str
    fastest: float
    median: float


def _bind(library: Any, name: str, arguments: list[Any], result: Any = ctypes.c_int) -> Any:
    function = getattr(library, name)
    function.argtypes, function.restype = arguments, result
    return function


def make_loop(library: Any) -> Any:
    """Return a compiled communication loop over the functions of one FMU."""
    try:
        from numba import njit
    except ImportError as error:
        raise SystemExit("numba is missing: pip install numba") from error

    array = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p]
    set_real = _bind(library, "fmi2SetReal", array)
    get_real = _bind(library, "fmi2GetReal", array)
    get_integer = _bind(library, "fmi2GetInteger", array)
    do_step = _bind(library, "fmi2DoStep", [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int])

    @njit
    def loop(component, step, in_refs, inputs, real_refs, reals, int_refs, ints):  # type: ignore[no-untyped-def]
        bad = 0
        for k in range(len(inputs)):
            if len(in_refs):
                bad |= set_real(component, in_refs.ctypes.data, len(in_refs), inputs[k].ctypes.data)
            bad |= do_step(component, k * step, step, 1)
            bad |= get_real(component, real_refs.ctypes.data, len(real_refs), reals[k].ctypes.data)
            if len(int_refs):
                bad |= get_integer(component, int_refs.ctypes.data, len(int_refs), ints[k].ctypes.data)
        return bad

    return loop


def measure(path: Path) -> list[Row]:
    """Time one FMU with inputs that change at every communication step, and with inputs held for 0.05 s."""
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave

    description = read_model_description(str(path))
    folder = extract(str(path))
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="speed",
    )
    fmu.instantiate()
    loop = make_loop(fmu.dll)
    experiment = description.defaultExperiment
    stop, step = float(experiment.stopTime), float(experiment.stepSize or 0.01)
    chosen = {
        kind: [v for v in description.modelVariables if v.causality == kind] for kind in ("input", "output")
    }
    references = [
        np.array([v.valueReference for v in variables], dtype=np.uint32)
        for variables in (
            chosen["input"],
            [v for v in chosen["output"] if v.type == "Real"],
            [v for v in chosen["output"] if v.type == "Integer"],
        )
    ]
    count = round(stop / step)
    random = np.random.default_rng(1)
    rows = []
    for label, hold in (("new at every step", step), ("held 0.05 s", 0.05)):
        times = []
        for run in range(RUNS + 1):
            instants = np.floor(np.arange(count) * step / hold + 1e-9) * hold
            columns = []
            for variable in chosen["input"]:
                points = random.uniform(float(variable.min), float(variable.max), CONTROL_POINTS)
                columns.append(PchipInterpolator(np.linspace(0, stop, CONTROL_POINTS), points)(instants))
            inputs = np.column_stack(columns) if columns else np.zeros((count, 1))
            reals = np.zeros((count, len(references[1])))
            integers = np.zeros((count, max(len(references[2]), 1)), dtype=np.int32)
            fmu.reset()
            fmu.setupExperiment(startTime=0.0)
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
            begin = time.thread_time()
            bad = loop(
                fmu.component, step, references[0], inputs, references[1], reals, references[2], integers
            )
            if run:  # the first run compiles the loop
                times.append(1e3 * (time.thread_time() - begin))
            if bad:
                raise SystemExit(f"{path.name}: a call failed")
        rows.append(
            Row(
                path.stem,
                stop,
                step,
                label if chosen["input"] else "none",
                min(times),
                float(np.median(times)),
            )
        )
    fmu.terminate()
    fmu.freeInstance()
    shutil.rmtree(folder, ignore_errors=True)
    return rows if chosen["input"] else rows[:1]


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("fmus", nargs="*", type=Path, metavar="FMU")
    arguments = parser.parse_args()
    paths = arguments.fmus or [ROOT / "fmus" / f"{name}.fmu" for name in SYSTEMS]
    processor = platform.processor() or platform.machine()
    print("# Time inside the FMUs\n")
    print(
        "`python bench/fmu_speed.py`: set inputs, doStep, get outputs in a numba loop on one core, no Python"
    )
    print(f"in between. {RUNS} simulations each, {CONTROL_POINTS} random control points; {processor}.\n")
    print("| FMU | stop time | communication step | inputs | fastest ms | median ms |")
    print("|---|---|---|---|---|---|")
    for path in paths:
        for row in measure(path):
            cells = [row.name, f"{row.stop:g} s", f"{row.step:g} s", row.inputs]
            print("| " + " | ".join([*cells, f"{row.fastest:.2f}", f"{row.median:.2f}"]) + " |")


if __name__ == "__main__":
    main()
