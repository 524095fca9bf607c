"""Does the hybrid engine need at most one simulation more than the better of its halves?

Five scripted stand-ins for a language model (LLM) answer through the real prompts:

- *second* gives a violating input from its second answer on,
- *fifth* does so from its fifth on, and is like *random* before that,
- *never* gives random constants within a tenth of the lower limits,
- *steps* does so until a sample has an input with several steps, then gives a violating input,
- *random* gives random inputs of up to four pieces, different ones each time.

The violating input is the one that the surrogate finds with a seed that the table does not use. Answers take
no time, so a question costs no more than a simulation. The LLM alone needs two simulations if it is *second*,
five if it is *fifth*; the others never find a violation alone, except by chance. The difference is taken for
each seed, with its standard error, to the half that needs fewer simulations on average. Engines are asked,
and told what the monitor says, without the loop of ``falsify``: violations are not confirmed a second time.

    nice -n 15 python bench/hybrid.py
    nice -n 15 python bench/hybrid.py --requirements CC3 --seeds 100-159
"""

import argparse
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import inf
from statistics import mean

# For the engines' small matrices, threads of the linear algebra cost more than they save.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from bench.search import seeds_from, with_error
from falsifier import Candidate, Problem, Signal, falsify, load_problem
from falsifier.core.ranges import InputRange
from falsifier.engines.hybrid import Hybrid
from falsifier.engines.llm import LLMEngine
from falsifier.engines.protocol import Engine
from falsifier.engines.surrogate import Surrogate
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.messages import ChatRequest
from falsifier.llm.scripted import ScriptedChat

REQUIREMENTS = ("AT1", "SC", "F16", "AT6c", "NNx", "AT6a")
# Changes of an input from which on it counts as stepping.
SEVERAL = 4
KINDS = ("second", "fifth", "never", "steps", "random")
# Simulations of an LLM alone that knows better from some answer on.
ALONE = {"second": 2, "fifth": 5}
MOST_PIECES = 4


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

    def see(self, evaluation: Evaluation) -> None:
        """See a simulation."""
        signals = evaluation.candidate.signals.values()
        self.has_seen_steps |= any(s.switches >= SEVERAL for s in signals)

    def answer(self, request: ChatRequest) -> str:
        """Answer one question."""
        self.answers += 1
        knows = self.answers >= ALONE.get(self.kind, inf) or (self.kind == "steps" and self.has_seen_steps)
        return _reply(self.right if knows else self.guess())

    def guess(self) -> Candidate:
        """Return something of no use: near the lower limits, or anywhere."""
        space = self.problem.space
        share, pieces = (1.0, MOST_PIECES) if self.kind in ("random", "fifth") else (0.1, 1)

        def signal(r: InputRange) -> Signal:
            count = int(self.rng.integers(1, pieces + 1)) if pieces > 1 else 1
            times = tuple(space.stop_time * i / count for i in range(count))
            return Signal(times, tuple(level(r.low, r.high) for _ in times), "constant")

        def level(low: float, high: float) -> float:
            return low + (high - low) * float(self.rng.uniform(0.0, share))

        return Candidate(
            {r.name: signal(r) for r in space.inputs},
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


def simulations(
    problem: Problem, engine: Engine, budget: int, see: Callable[[Evaluation], None] | None = None
) -> int:
    """Return the number of simulations until the first violation, at most the budget."""
    for count in range(1, budget):
        evaluation = evaluate(problem, engine.ask()[0])
        if evaluation.violated:
            return count
        engine.tell([evaluation])
        if see is not None:
            see(evaluation)
    return budget


def led(problem: Problem, one: StandIn, budget: int) -> int:
    """Return the number of simulations of the hybrid with a stand-in."""
    engine = Hybrid(problem, seed=one.seed, adviser=LLMEngine(problem, one.chat))
    engine.attach(lambda _: None, lambda chat: chat)
    engine.begin(budget)
    return simulations(problem, engine, budget, one.see)


def rows(name: str, seeds: range, budget: int, kinds: Sequence[str]) -> None:
    """Print the rows of one requirement."""
    problem = load_problem(name)
    right = violating(problem, seed=1)
    alone = [simulations(problem, Surrogate(problem, seed=seed), budget) for seed in seeds]
    for kind in kinds:
        both = [led(problem, StandIn(kind, problem, right, seed), budget) for seed in seeds]
        llm = ALONE.get(kind, inf)
        better = [int(llm)] * len(alone) if mean(alone) > llm else alone
        more = [b - a for b, a in zip(both, better, strict=True)]
        cells = (name, kind, *(with_error(values, 2) for values in (alone, both, more)))
        print(f"| {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--requirements", nargs="+", default=REQUIREMENTS)
    parser.add_argument("--kinds", nargs="+", default=KINDS, choices=KINDS)
    parser.add_argument("--seeds", type=seeds_from, default=range(500, 560), help="for example 500-559")
    parser.add_argument("--budget", type=int, default=60)
    arguments = parser.parse_args()
    print("| requirement | LLM | surrogate alone | hybrid | more than the better half |")
    print("|---|---|---|---|---|")
    for name in arguments.requirements:
        rows(name, arguments.seeds, arguments.budget, arguments.kinds)


if __name__ == "__main__":
    main()
