"""Overhead of a search over the FMU's own time: 1000 evaluations of AT1 with monitor and journal.

    python -m bench.evaluations

The FMU's own time is measured with the same candidates in the same worker, but without sampling of the
inputs, monitor and journal.
"""

import argparse
import tempfile
from time import perf_counter

from falsifier import falsify, load_problem, make_engine
from falsifier.evaluation.evaluate import monitor_for

COUNT = 1000
ROUNDS = 3


def main() -> None:
    """Print both times and their ratio, the best of several rounds."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter).parse_args()
    # No input reaches this bound, so the search does not stop early.
    problem = load_problem("AT1", stl="G[0,20] (speed <= 1000)")
    candidates = make_engine("uniform", problem, seed=1).ask(COUNT)
    for candidate in candidates[:20]:  # compiles the loops and starts the worker
        trajectory = problem.model.simulate(candidate.signals, {}, problem.experiment)
    monitor_for(problem).evaluate(trajectory)
    own, whole = [], []
    for _ in range(ROUNDS):
        started = perf_counter()
        for candidate in candidates:
            problem.model.simulate(candidate.signals, {}, problem.experiment)
        own.append(perf_counter() - started)
        with tempfile.TemporaryDirectory() as folder:
            started = perf_counter()
            result = falsify(problem, "uniform", seed=1, budget=COUNT, directory=folder)
            whole.append(perf_counter() - started)
        assert len(result.evaluations) == COUNT
    print(f"{COUNT} evaluations of AT1, best of {ROUNDS} rounds")
    print(f"simulations alone        {min(own):.2f} s")
    print(f"with monitor and journal {min(whole):.2f} s")
    print(f"ratio                    {min(whole) / min(own):.2f}")


if __name__ == "__main__":
    main()
