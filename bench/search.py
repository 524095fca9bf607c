"""How many simulations do the engines need, compared with the published numbers?

Each run is a search with the public API until a violation is confirmed or the budget is used up. FR is the
number of falsified runs, S the mean number of simulations over them with its standard error. Seeds 100 to
109 and 300 to 309 were not used while developing the engines. Dwell is the shortest time between two changes
of a counterexample's input, switches is the number of changes, both as medians over the counterexamples; they
show how plausible the inputs of a free parameterization are.

    python bench/search.py                                    # default engine, free parameterization
    python bench/search.py --parameterization fixed --requirements CC1 CC2
    python bench/search.py --engine uniform --budget 1500 --seeds 100-109
"""

import argparse
import os
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from statistics import mean, median, stdev
from typing import Any

# For the engines' small matrices, threads of the linear algebra cost more than they save.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from falsifier import DEFAULT_ENGINE, ENGINES, Result, falsify, load_problem

ROOT = Path(__file__).resolve().parents[1]
SYSTEMS = {
    "AT": ("AT1", "AT2", "AT51", "AT52", "AT53", "AT54", "AT6a", "AT6b", "AT6c", "AT6abc"),
    "NN": ("NN", "NNb", "NNx"),
    "CC": ("CC1", "CC2", "CC3", "CC4", "CC5", "CCx"),
    "F16": ("F16",),
    "SC": ("SC",),
    "AFC": ("AFC27", "AFC29", "AFC33"),
    "PulseMeter": ("PulseMeter",),
    "ChargerHandshake": ("ChargerHandshake",),
    "HeaterLimpHome": ("HeaterLimpHome",),
}
# Requirements for which the published tools need hundreds of simulations.
LONG = {"CC4": 1500, "CCx": 1500}


def row(requirement: str, results: Sequence[Result], published: dict[str, Any]) -> str:
    """Return one row of the table."""
    counts = [r.spent.simulations for r in results if r.falsified]
    found = [r.counterexample.candidate for r in results if r.counterexample is not None]
    dwells = [s.shortest_dwell for c in found for s in c.signals.values() if s.shortest_dwell is not None]
    switches = [sum(s.switches for s in c.signals.values()) for c in found if c.signals]
    missed = ", ".join(f"{r.robustness:.3g}" for r in results if not r.falsified)
    cells = [
        requirement,
        _published(published["best"].get(requirement)),
        _published(published["uniform"].get(requirement)),
        f"{len(counts)}/{len(results)}",
        with_error(counts),
        f"{median(counts):g}" if counts else "–",
        str(max(counts)) if counts else "–",
        f"{median(dwells):.2g}" if dwells else "–",
        f"{median(switches):g}" if switches else "–",
        f"{mean(r.spent.engine_seconds / r.spent.simulations for r in results):.2f}",
        missed or "–",
    ]
    return f"| {' | '.join(cells)} |"


def with_error(values: Sequence[float], digits: int = 1) -> str:
    """Return the mean with its standard error, which a single value does not have."""
    if not values:
        return "–"
    error = f" ± {stdev(values) / len(values) ** 0.5:.{digits}f}" if len(values) > 1 else ""
    return f"{mean(values):.{digits}f}{error}"


def _published(entry: dict[str, Any] | None) -> str:
    if not entry:
        return "–"
    value = f"{entry['mean']:.1f}" if "mean" in entry else "–"
    return f"{entry['falsified']}: {value}"


def seeds_from(text: str) -> range:
    """Return the seeds that a command line names: ``7`` or ``100-109``, both ends included."""
    first, _, last = text.partition("-")
    if not (seeds := range(int(first), int(last or first) + 1)):
        raise argparse.ArgumentTypeError(f"{text}: expected FIRST-LAST with FIRST <= LAST")
    return seeds


def main() -> None:
    """Print the table, row by row."""
    known = [name for names in SYSTEMS.values() for name in names]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--engine", choices=sorted(set(ENGINES) - {"hybrid"}), default=DEFAULT_ENGINE)
    parser.add_argument("--requirements", nargs="+", choices=known, default=known, metavar="NAME")
    parser.add_argument("--seeds", type=seeds_from, default=range(100, 110), help="for example 100-109")
    parser.add_argument(
        "--budget",
        type=int,
        help="maximum number of simulations; default: 300, for CC4 and CCx 1500",
    )
    parser.add_argument("--parameterization", choices=["free", "fixed"], default="free")
    options = parser.parse_args()
    published = tomllib.loads((ROOT / "specs" / "published.toml").read_text("utf-8"))
    print(
        f"Engine `{options.engine}`, {options.parameterization} parameterization, seeds {options.seeds[0]}",
        end="",
    )
    print(f" to {options.seeds[-1]}\n")
    print(
        "| requirement | best tool FR: S | uniform FR: S | FR | S | median | max | dwell [s] | switches "
        "| s/proposal | best robustness of the other runs |"
    )
    print(f"|{'---|' * 11}")
    for requirement in options.requirements:
        system = next(name for name, requirements in SYSTEMS.items() if requirement in requirements)
        problem = load_problem(f"{system}:{requirement}", parameterization=options.parameterization)
        budget = options.budget or LONG.get(requirement, 300)
        results = [falsify(problem, options.engine, seed=seed, budget=budget) for seed in options.seeds]
        print(row(requirement, results, published), flush=True)
    sys.stdout.flush()


if __name__ == "__main__":
    main()
