"""Does the hybrid engine need at most one simulation more than the better of its halves?

Three scripted stand-ins for a language model (LLM) answer through the real prompts. *second* gives a
violating input from its second answer on, *never* gives random constants near the lower limits, and *steps*
gives a violating input once a sample has an input with several steps. The violating input is the one that the
surrogate finds with a seed that the table does not use. Answers take no time, so a question costs no more
than a simulation.

    nice -n 15 python bench/hybrid.py
    nice -n 15 python bench/hybrid.py --requirements CC5 --seeds 100-119
"""

import argparse
import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from statistics import mean, stdev

# For the engines' small matrices, threads of the linear algebra cost more than they save.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from falsifier import Budget, Candidate, Problem, Signal, falsify, load_problem
from falsifier.llm.messages import ChatRequest
from falsifier.llm.scripted import ScriptedChat
from falsifier.search.events import Evaluated, Event

REQUIREMENTS = ("AT1", "SC", "F16")
# Changes of an input from which on it counts as stepping.
SEVERAL = 4
KINDS = ("second", "never", "steps")


@dataclass
class StandIn:
    """Answers like an LLM of one kind.

    Attributes:
        kind: one of KINDS.
        problem: what is searched.
        right: a violating candidate.
        seed: of what it guesses.
    """

    kind: str
    problem: Problem
    right: Candidate
    seed: int
    answers: int = 0
    has_seen_steps: bool = False
    chat: ScriptedChat = field(init=False)

    def __post_init__(self) -> None:
        self.chat = ScriptedChat(self.answer)
        self.rng = np.random.default_rng(self.seed)

    def __call__(self, event: Event) -> None:
        """See a simulation."""
        if isinstance(event, Evaluated):
            signals = event.evaluation.candidate.signals.values()
            self.has_seen_steps |= any(s.switches >= SEVERAL for s in signals)

    def answer(self, request: ChatRequest) -> str:
        """Answer one question."""
        self.answers += 1
        knows = {"second": self.answers > 1, "never": False, "steps": self.has_seen_steps}[self.kind]
        return _reply(self.right if knows else self.guess())

    def guess(self) -> Candidate:
        """Return random constants near the lower limits."""
        space = self.problem.space

        def level(low: float, high: float) -> float:
            return low + (high - low) * float(self.rng.uniform(0.0, 0.1))

        return Candidate(
            {r.name: Signal((0.0,), (level(r.low, r.high),), "constant") for r in space.inputs},
            {p.name: level(p.low, p.high) for p in space.parameters},
        )


def _reply(candidate: Candidate) -> str:
    signals = [
        {"name": n, "interpolation": s.interpolation, "times": list(s.times), "values": list(s.values)}
        for n, s in candidate.signals.items()
    ]
    parameters = [{"name": n, "value": v} for n, v in candidate.parameters.items()]
    one = {"rationale": "scripted", "signals": signals, "parameters": parameters}
    return json.dumps({"candidates": [one]})


def violating(problem: Problem, seed: int) -> Candidate:
    """Return an input that violates the requirement, as the surrogate finds it."""
    result = falsify(problem, seed=seed, budget=500)
    assert result.counterexample is not None, f"{problem.name}: nothing found with seed {seed}"
    return result.counterexample.candidate


def simulations(run: Callable[[int], int], seeds: range) -> str:
    """Return mean and standard error of the number of simulations over seeds."""
    counts = [run(seed) for seed in seeds]
    return f"{mean(counts):.1f} ± {stdev(counts) / len(counts) ** 0.5:.1f}"


def rows(name: str, seeds: range, budget: int, kinds: tuple[str, ...]) -> None:
    """Print the rows of one requirement."""
    problem = load_problem(name)
    right = violating(problem, seed=1)
    limits = Budget(simulations=budget)

    def surrogate(seed: int) -> int:
        return falsify(problem, seed=seed, budget=limits).spent.simulations

    def led(kind: str, engine: str | None) -> Callable[[int], int]:
        def run(seed: int) -> int:
            one = StandIn(kind, problem, right, seed)
            result = falsify(problem, engine, llm=one.chat, seed=seed, budget=limits, listeners=[one])
            return result.spent.simulations

        return run

    alone = simulations(surrogate, seeds)
    for kind in kinds:
        # Without help it never steps, and each run takes the whole budget.
        led_alone = simulations(led(kind, None), seeds) if kind == "second" else f"over {budget}"
        print(
            f"| {name} | {kind} | {led_alone} | {alone} | {simulations(led(kind, 'hybrid'), seeds)} |",
            flush=True,
        )


def main() -> None:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--requirements", nargs="+", default=REQUIREMENTS)
    parser.add_argument("--kinds", nargs="+", default=KINDS, choices=KINDS)
    parser.add_argument("--seeds", default="100-109")
    parser.add_argument("--budget", type=int, default=60)
    arguments = parser.parse_args()
    first, _, last = arguments.seeds.partition("-")
    seeds = range(int(first), int(last or first) + 1)
    print("| requirement | LLM | LLM alone | surrogate alone | hybrid |")
    print("|---|---|---|---|---|")
    for name in arguments.requirements:
        rows(name, seeds, arguments.budget, tuple(arguments.kinds))


if __name__ == "__main__":
    main()
