"""Two coupled FMUs against one, and against FMPy's SSP simulation: 1000 communication steps of trivial FMUs.

Usage: python -m bench.systems. Prints the tables. Committed result: bench/systems.md.

The FMUs are those of the tests (tests/fixtures/fmus): a first-order lag that does one Runge-Kutta step per
communication step, so that what surrounds the FMUs is what is measured. Each row is the fastest of many
simulations, and the rows take turns, because a busy machine only ever adds time.
"""

from __future__ import annotations

import argparse
import platform
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from falsifier import Coupling, Experiment, FmuModel, Signal, System
from tests.fmu.packages import structure, system, write

ROUNDS, FMPY_ROUNDS = 300, 60
STOP, STEP = 10.0, 0.01
FOLDER = Path(__file__).parent.parent / "tests" / "fixtures" / "fmus"
ONE = Signal((0.0,), (1.0,))
LAG = """<ssd:Component name="{name}" source="resources/CheapLag_2.fmu"><ssd:Connectors>
  <ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>
  <ssd:Connector name="y" kind="output"><ssc:Real/></ssd:Connector>
</ssd:Connectors></ssd:Component>"""
CHAIN = """<ssd:Connection startConnector="u" endElement="a" endConnector="u"/>
<ssd:Connection startElement="a" startConnector="y" endElement="b" endConnector="u"/>"""
PORT = '<ssd:Connectors><ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector></ssd:Connectors>'


def ours(model: FmuModel | System, drive: str, *outputs: str) -> Callable[[], float]:
    """Return a function that simulates once and returns the last value of the last output."""
    experiment = Experiment(STOP, STEP, outputs)
    signals = {drive: ONE} if drive else {}
    return lambda: float(model.simulate(signals, {}, experiment)[outputs[-1]][-1])


def fmpy(package: Path, stop: float = STOP) -> Callable[[], float]:
    """Return a function that simulates the package once with FMPy."""
    from fmpy.ssp.simulation import simulate_ssp

    def simulate() -> float:
        result = simulate_ssp(str(package), stop_time=stop, step_size=STEP, input={"u": lambda _: 1.0})
        return float(result["b.y"][-1])

    return simulate


def fastest(runs: dict[str, Callable[[], float]], rounds: int) -> dict[str, float]:
    """Return the fastest of many turns of each, in s."""
    best = dict.fromkeys(runs, float("inf"))
    for _ in range(rounds):
        for name, run in runs.items():
            started = time.perf_counter()
            run()
            best[name] = min(best[name], time.perf_counter() - started)
    return best


def main() -> None:
    """Measure and print."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter).parse_args()
    lag, chained = FOLDER / "CheapLag_2.fmu", {"b.u": "a.y"}
    third = FOLDER / "CheapLag_3.fmu"
    chain = System({"a": lag, "b": lag}, chained)
    each = System({"a": lag, "b": lag}, chained, coupling=Coupling(isolation="each"))
    closed = System({"a": lag, "b": lag}, {"b.u": "a.y", "a.u": "b.y"})
    runs = {
        "one FMU": ours(FmuModel(lag), "u", "y"),
        "two FMUs, one after the other": ours(chain, "a.u", "a.y", "b.y"),
        "two FMUs in a loop": ours(closed, "", "a.y", "b.y"),
        "two FMUs of FMI 3, one after the other": ours(
            System({"a": third, "b": third}, chained), "a.u", "a.y", "b.y"
        ),
        "two FMUs, each in a process of its own": ours(each, "a.u", "a.y", "b.y"),
    }
    for run in runs.values():
        for _ in range(5):
            run()
    best = fastest(runs, ROUNDS)
    print("\n| | ms | times one FMU |\n|---|---|---|")
    for name, seconds in best.items():
        print(f"| {name} | {1000 * seconds:.3f} | {seconds / best['one FMU']:.2f} |")
    against_fmpy(runs["two FMUs, one after the other"])
    print(f"\n{platform.machine()}, Python {platform.python_version()}")


def against_fmpy(run: Callable[[], float]) -> None:
    """Compare with FMPy on the same system."""
    with tempfile.TemporaryDirectory() as folder:
        ssd = structure(system(LAG.format(name="a") + LAG.format(name="b"), CHAIN, before=PORT))
        package = write(Path(folder) / "chain.ssp", ssd, "CheapLag_2")
        best = fastest({"all": fmpy(package), "start": fmpy(package, STEP)}, FMPY_ROUNDS)
        # Not in turns with FMPy, which leaves the processor's caches empty.
        own = fastest({"ours": run}, ROUNDS)["ours"]
        steps = best["all"] - best["start"]
        print(
            f"\nThe same two with fmpy.ssp.simulation: {1000 * best['all']:.1f} ms, of which "
            f"{1000 * best['start']:.1f} ms for unpacking and the first step; here {1000 * own:.3f} ms: "
            f"{best['all'] / own:.0f} times faster, {steps / own:.0f} times without FMPy's unpacking."
        )
        other = fmpy(package)
        print(f"Last values: FMPy {other():.6f}, here {run():.6f}.")


if __name__ == "__main__":
    main()
