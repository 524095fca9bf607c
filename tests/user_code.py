"""A file as a user writes it, which mypy checks: statements have the types that the documentation states."""

from pathlib import Path
from typing import assert_type

from falsifier import (
    Budget,
    Candidate,
    Confirmation,
    Engine,
    Evaluation,
    Event,
    Experiment,
    FmuModel,
    Formula,
    Freedom,
    InputRange,
    Problem,
    ProblemSource,
    Requirement,
    Result,
    SearchSpace,
    Signal,
    Trajectory,
    explain,
    falsify,
    load_problem,
    parse,
    resume,
    shrink,
    simulate,
)

formula: Formula = parse("G[0,10] (h >= 0)")
space = SearchSpace((InputRange("u", -1.0, 1.0, control_points=3, free=Freedom(10, 0.5)),), (), 10.0)
problem = Problem(FmuModel(Path("my.fmu")), Requirement("R", formula), space, Experiment(10.0, 0.1, ("h",)))
other: Problem = Problem.from_fmu("my.fmu", "G[0,10] (h >= 0)", inputs={"u": (-1, 1)})


def heard(event: Event) -> None:
    print(event)


class Mine:
    name = "mine"

    def ask(self, n: int = 1) -> list[Candidate]:
        return [Candidate({"u": Signal((0.0,), (1.0,))})] * n

    def tell(self, evaluations: object) -> None:
        pass


engine: Engine = Mine()
result: Result = falsify(problem, engine, budget=Budget(simulations=5, cost=1.0), listeners=[heard])
results: list[Result] = falsify([problem, other], "surrogate", directory=Path("runs/a"))
mixed: list[Result] = falsify([problem, "AT1"])
another: list[Result] = falsify((problem, "AT1"))
names = ["AT1", "AT2"]
by_name: list[Result] = falsify(names)
from_source: Result = falsify(ProblemSource(target="AT:AT1"))
again: list[Result] = resume("runs/a")
found: Confirmation | None = result.counterexample
robustness: float | None = result.robustness
falsified: bool = result.falsified
if found is not None:
    found.plot().savefig("a.png")
    trajectory: Trajectory | None = shrink(problem, found.evaluation).evaluation.trajectory
    text: str = explain(problem, found.evaluation).text
evaluation: Evaluation = simulate(load_problem("AT1"), {"throttle": 100.0})
assert_type(falsify("AT1"), Result)
assert_type(falsify(names), list[Result])
falsify(3)  # type: ignore[call-overload]
