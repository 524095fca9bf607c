"""Do the bundled models behave like the published ones? A test with uniform random inputs.

Samples each requirement's search space uniformly, counts violations, and compares 1/p with the published mean
number of simulations until the first violation, if there is one. The mean of ten such numbers has a standard
error of about 1/p / sqrt(10), so z = (published / measured - 1) * sqrt(10). If not all ten published runs
falsified within 1500 simulations, P is the probability of a number of falsified runs that is no more likely
than the published one.

    python bench/fidelity.py              # the table of bench/fidelity.md
    python bench/fidelity.py AT CC --share 0.1
"""

import argparse
import sys
import time
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from falsifier.core.ranges import ParameterRange
from falsifier.evaluation.evaluate import evaluate, monitor_for
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, slots=True)
class Row:
    """Problems that share their simulations, and the number of simulations.

    Attributes:
        requirements: names of bundled requirements with the same search space.
        samples: number of simulations.
        variant: difference from the spec, in words; empty if there is none.
        volume: share of the spec's search space that is sampled; no violation is known outside it.
    """

    requirements: tuple[str, ...]
    samples: int
    variant: str = ""
    volume: float = 1.0


ROWS = {
    "AT": [
        Row(("AT1", "AT2", "AT51", "AT52", "AT53", "AT54", "AT6a", "AT6b", "AT6c", "AT6abc"), samples=40000)
    ],
    "CC": [Row(("CC1", "CC2", "CC3", "CC4", "CC5", "CCx"), samples=12000)],
    "NN": [
        Row(("NN", "NNb"), samples=4000),
        Row(("NN", "NNb"), samples=4000, variant="8 held pieces"),
        Row(("NNx",), samples=3000),
    ],
    "F16": [
        Row(("F16",), samples=5000),
        Row(
            ("F16",),
            samples=2000,
            variant="roll in the top 10 %, pitch in the lowest 0.2 %",
            volume=0.1 * 0.002,
        ),
    ],
    "SC": [Row(("SC",), samples=2000)],
    "PM": [Row(("PM",), samples=2000)],
    "AFC": [
        Row(("AFC27",), samples=4000),
        Row(("AFC29",), samples=1500),
        Row(("AFC33",), samples=1500),
    ],
    "ATsplit": [
        Row(
            tuple(f"ATsplit{k}" for k in ("1", "2", "51", "52", "53", "54", "6a", "6b", "6c", "6abc")),
            samples=10000,
        )
    ],
    "CCcars": [
        Row(("CCcars1", "CCcars2", "CCcars3", "CCcars4", "CCcars5", "CCcarsx"), samples=4000),
    ],
    "F16split": [
        Row(
            ("F16split",),
            samples=1000,
            variant="roll in the top 10 %, pitch in the lowest 0.2 %",
            volume=0.1 * 0.002,
        ),
    ],
    "PulseMeter": [Row(("PulseMeter",), samples=200000)],
    "ChargerHandshake": [Row(("ChargerHandshake",), samples=200000)],
    "HeaterLimpHome": [Row(("HeaterLimpHome",), samples=200000)],
}


# Systems of FMUs, and the single FMU with whose published numbers they are compared.
WHOLES = {"ATsplit": "AT", "CCcars": "CC", "F16split": "F16"}


@dataclass(frozen=True, slots=True)
class Count:
    """Violations of one requirement.

    Attributes:
        requirement: its name.
        row: the simulated problems.
        samples: number of simulations.
        violations: number of simulations that violate it.
        lowest: lowest robustness.
    """

    requirement: str
    row: Row
    samples: int
    violations: int
    lowest: float

    @property
    def probability(self) -> float:
        """Share of the whole search space that violates."""
        return self.violations / self.samples * self.row.volume


def problems(system: str, row: Row) -> list[Problem]:
    """Load the problems of a row, with its variant."""
    loaded = [load_problem(f"{system}:{name}") for name in row.requirements]
    if row.variant == "8 held pieces":
        return [_held(problem) for problem in loaded]
    if row.volume < 1:
        return [_cornered(problem) for problem in loaded]
    return loaded


def _held(problem: Problem) -> Problem:
    inputs = tuple(replace(r, interpolation="constant") for r in problem.space.inputs)
    return replace(problem, space=replace(problem.space, inputs=inputs))


def _cornered(problem: Problem) -> Problem:
    def narrowed(p: ParameterRange) -> ParameterRange:
        width = p.high - p.low
        name = p.name.removeprefix("aircraft.")
        if name == "roll":
            return replace(p, low=p.high - 0.1 * width)
        return replace(p, high=p.low + 0.002 * width) if name == "pitch" else p

    parameters = tuple(narrowed(p) for p in problem.space.parameters)
    return replace(problem, space=replace(problem.space, parameters=parameters))


def count(system: str, row: Row, samples: int, seed: int) -> list[Count]:
    """Simulate uniform random candidates and evaluate all requirements of the row on each."""
    rng = np.random.default_rng(seed)
    group = problems(system, row)
    first = group[0]
    low, high = first.space.bounds.T
    robustness = np.empty((samples, len(group)))
    for k in range(samples):
        evaluation = evaluate(first, first.space.decode(rng.uniform(low, high)))
        if evaluation.trajectory is None or evaluation.robustness is None:
            raise SystemExit(
                f"{first.name}: simulation {k} ended as {evaluation.status}: {evaluation.reason}"
            )
        robustness[k, 0] = evaluation.robustness
        for i, problem in enumerate(group[1:], start=1):
            robustness[k, i] = monitor_for(problem).evaluate(evaluation.trajectory).robustness
    first.model.close()
    return [
        Count(p.name, row, samples, int((column < 0).sum()), float(column.min()))
        for p, column in zip(group, robustness.T, strict=True)
    ]


def expected_runs(probability: float, budget: int, runs: int) -> float:
    """Return the expected number of runs that falsify within the budget."""
    return runs * (1 - (1 - probability) ** budget)


def agreement(found: Count, falsified: int, budget: int, runs: int) -> float:
    """Return the probability of a number of falsified runs that is no more likely than the published one.

    The measured probability has a counting error: its posterior is a gamma distribution (Jeffreys' prior),
    over which the binomial distribution of falsified runs is averaged.
    """
    from scipy.stats import binom, gamma

    quantiles = (np.arange(400) + 0.5) / 400
    shares = gamma.ppf(quantiles, found.violations + 0.5) / found.samples * found.row.volume
    successes = 1 - (1 - np.minimum(shares, 1.0)) ** budget
    outcomes = binom.pmf(np.arange(runs + 1)[:, np.newaxis], runs, successes).mean(axis=1)
    return float(outcomes[outcomes <= outcomes[falsified] * (1 + 1e-9)].sum())


def line(found: Count, published: dict[str, Any]) -> str:
    """Return one line of the table."""
    p = found.probability
    error = sqrt(found.violations) / found.samples * found.row.volume
    mean = 1 / p if p else inf
    cells = [
        found.requirement + (f" ({found.row.variant})" if found.row.variant else ""),
        f"{found.violations} / {found.samples}",
        f"{p:.2g} ± {error:.1g}" if p else f"< {3 * found.row.volume / found.samples:.1g}",
        f"{mean:.4g}" if isfinite(mean) else "never",
        f"{found.lowest:+.4g}",
    ]
    uniform = published["uniform"].get(_published_name(found.requirement))
    if uniform is None:
        return _cells([*cells, "", "", ""])
    budget, runs = published["budget"]["uniform"], published["runs"]
    falsified = uniform["falsified"]
    text = f"{falsified}/{runs}" + (f", {uniform['mean']:g}" if "mean" in uniform else "")
    expected = expected_runs(p, budget, runs)
    if falsified == runs and p > 0:
        z = (uniform["mean"] * p - 1) * sqrt(runs)
        verdict = f"z = {z:+.1f}"
    else:
        verdict = f"P = {agreement(found, falsified, budget, runs):.2f}"
    return _cells([*cells, text, f"{expected:.1f}/{runs}", verdict])


def _published_name(requirement: str) -> str:
    for parts, whole in WHOLES.items():
        if requirement.startswith(parts):
            return whole + requirement.removeprefix(parts)
    return requirement


def _cells(texts: Sequence[str]) -> str:
    return "| " + " | ".join(texts) + " |"


def table(systems: Sequence[str], share: float, seed: int) -> Iterator[str]:
    """Yield the lines of the table, each as soon as it has been measured."""
    published = tomllib.loads((ROOT / "specs" / "published.toml").read_text(encoding="utf-8"))
    header = ["requirement", "violations", "p", "1/p", "lowest robustness"]
    header += ["published: falsified runs, mean", "expected runs", "agreement"]
    yield _cells(header)
    yield _cells(["---"] * len(header))
    for system in systems:
        for row in ROWS[system]:
            for found in count(system, row, max(1, round(row.samples * share)), seed):
                yield line(found, published)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("systems", nargs="*", default=list(ROWS), help=f"default: {', '.join(ROWS)}")
    parser.add_argument("--share", type=float, default=1.0, help="fraction of the samples to simulate")
    parser.add_argument("--seed", type=int, default=20250601)
    options = parser.parse_args()
    started = time.perf_counter()
    for text in table(options.systems, options.share, options.seed):
        print(text, flush=True)
    print(f"{time.perf_counter() - started:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
