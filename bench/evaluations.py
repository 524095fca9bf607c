"""What a search costs beyond the FMU: 1000 evaluations of AT1 with monitor and journal.

    python -m bench.evaluations

The FMU's own time is that of the same candidates simulated in the same worker, without sampling of
inputs for the trajectory, without monitor and without journal.
"""

import tempfile
from time import perf_counter

from falsifier import falsify, load_problem, make_engine
from falsifier.evaluation.evaluate import monitor_for

COUNT = 1000
ROUNDS = 3


def main() -> None:
    """Print the two times and their ratio, the best of some rounds."""
    # A bound that no input reaches: all evaluations are made.
    problem = load_problem("AT1", stl="G[0,20] (speed <= 1000)")
    candidates = make_engine("uniform", problem, seed=1).ask(COUNT)
    for candidate in candidates[:20]:  # compiles, and starts the worker
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
