"""One search of psy-taliro, for peers.py: run by the interpreter of an environment that has psy-taliro.

Reads the task as a line of JSON from stdin, then writes each sample as a line and reads its cost as a line.
"""

import json
import sys
from typing import Any

from staliro import Inputs, Result, Sample, TestOptions, costfunc, staliro
from staliro.optimizers import DualAnnealing, UniformRandom

OPTIMIZERS = {"uniform": UniformRandom, "dual annealing": DualAnnealing}


def main() -> None:
    """Search until the cost is negative or the budget is used up."""
    task = json.loads(sys.stdin.readline())

    def cost(inputs: Inputs[Sample]) -> Result[float, None]:
        print(json.dumps(inputs.sample.values.tolist()), flush=True)
        return Result(float(sys.stdin.readline()), None)

    bounds: dict[str, Any] = {f"x{i}": tuple(pair) for i, pair in enumerate(task["bounds"])}
    options = TestOptions(
        runs=1, iterations=task["budget"], seed=task["seed"], static_inputs=bounds, tspan=(0.0, 1.0)
    )
    staliro(costfunc(cost), OPTIMIZERS[task["optimizer"]](min_cost=0.0), options)


if __name__ == "__main__":
    main()
