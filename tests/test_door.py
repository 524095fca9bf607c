"""The public API as a user's type checker and editor see it."""

import subprocess
import sys
from pathlib import Path

import pytest

import falsifier

USER = """
from pathlib import Path

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
    FunctionModel,
    InputRange,
    ModelInfo,
    ParameterRange,
    Problem,
    Requirement,
    Result,
    SearchSpace,
    Signal,
    Trajectory,
    Variable,
    confirm,
    evaluate,
    explain,
    falsify,
    load_problem,
    make_engine,
    parse,
    plot,
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
again: list[Result] = resume("runs/a")
found: Confirmation | None = result.counterexample
robustness: float | None = result.robustness
falsified: bool = result.falsified
if found is not None:
    found.plot().savefig("a.png")
    trajectory: Trajectory | None = shrink(problem, found.evaluation).evaluation.trajectory
    text: str = explain(problem, found.evaluation).text
evaluation: Evaluation = simulate(load_problem("AT1"), {"throttle": 100.0})
reveal_type(falsify("AT1"))
"""


def test_a_users_file_is_typed(tmp_path: Path) -> None:
    (tmp_path / "user.py").write_text(USER)
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), "user.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert 'Revealed type is "falsifier.search.result.Result"' in done.stdout


@pytest.mark.parametrize("name", falsifier.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(falsifier, name) is not None
    assert name in dir(falsifier)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'falsfy'"):
        falsifier.falsfy  # type: ignore[attr-defined]


def test_importing_is_cheap() -> None:
    code = "import time; t = time.process_time(); import falsifier; print(time.process_time() - t)"
    times = [
        float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
        for _ in range(3)
    ]
    assert min(times) < 0.3
