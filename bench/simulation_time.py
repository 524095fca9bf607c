"""What one simulation of each bundled system takes, with its process: inputs in, trajectory out.

``python -m bench.simulation_time [--rounds N]``; committed result: bench/worker.md.
"""

import argparse
import os
import time
from statistics import median

from falsifier import load_problem, simulate

REQUIREMENTS = (
    *("AT1", "CC1", "NN", "SC", "F16", "AFC27", "PM", "PulseMeter", "ChargerHandshake", "HeaterLimpHome"),
    *("SharedFeeder", "ATsplit1", "CCcars1", "F16split"),
)


def times(requirement: str, rounds: int) -> list[float]:
    """Milliseconds of simulations with all inputs and parameters in the middle of their ranges."""
    problem = load_problem(requirement)
    middle = [0.5 * (dimension.low + dimension.high) for dimension in problem.space.dimensions]
    candidate = problem.space.decode(middle)
    for _ in range(3):  # the worker finds out how the FMU starts again
        simulate(problem, candidate.signals, candidate.parameters)
        time.sleep(0.3)
    found = []
    for _ in range(rounds):
        began = time.perf_counter()
        simulate(problem, candidate.signals, candidate.parameters)
        found.append(1e3 * (time.perf_counter() - began))
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=40)
    rounds = parser.parse_args().rounds
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; minimum (median) of {rounds} in ms\n")
    for requirement in REQUIREMENTS:
        found = times(requirement, rounds)
        print(f"| {requirement} | {min(found):.2f} ({median(found):.2f}) |", flush=True)


if __name__ == "__main__":
    main()
