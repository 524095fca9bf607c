"""How long does an engine take for a proposal, and does that grow with the history?

    python bench/proposal_time.py                      # default engine, AT51, free parameterization
    python bench/proposal_time.py --engine bayesian --requirement CC4

Processor time of ask and tell, in a search that continues after a violation. Committed result:
bench/proposal_time.md.
"""

import argparse
import os
import time
from itertools import pairwise

# For the engines' small matrices, threads of the linear algebra cost more than they save.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from falsifier.engines import DEFAULT_ENGINE, ENGINES, make_engine
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.loading import load_problem

EDGES = (0, 50, 60, 100, 200, 300, 400, 500)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--engine", choices=sorted(set(ENGINES) - {"hybrid"}), default=DEFAULT_ENGINE)
    parser.add_argument("--requirement", default="AT51")
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--simulations", type=int, default=EDGES[-1])
    options = parser.parse_args()
    problem = load_problem(options.requirement)
    engine = make_engine(options.engine, problem, seed=options.seed)
    seconds = []
    for _ in range(options.simulations):
        started = time.process_time()
        (candidate,) = engine.ask(1)
        asking = time.process_time() - started
        evaluation = evaluate(problem, candidate)
        started = time.process_time()
        engine.tell([evaluation])
        seconds.append(asking + time.process_time() - started)
    print(f"`{options.engine}` on {options.requirement}, seed {options.seed}.\n")
    print("| earlier simulations | mean s | max s |\n|---|---|---|")
    for first, last in pairwise((*(e for e in EDGES if e < options.simulations), options.simulations)):
        part = seconds[first:last]
        print(f"| {first} to {last - 1} | {sum(part) / len(part):.3f} | {max(part):.3f} |")


if __name__ == "__main__":
    main()
