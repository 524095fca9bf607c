import math
import pickle
from dataclasses import replace
from typing import Any

import pytest

from falsifier.core.files import bundled
from falsifier.core.model import Experiment
from falsifier.core.space import InputRange, SearchSpace
from falsifier.errors import SpecError
from falsifier.problem.loading import load_source
from falsifier.problem.problem import Problem, alike
from falsifier.problem.requirement import Requirement
from falsifier.stl import parse
from falsifier.testing import START, lag_problem

AT = bundled("fmus") / "AT.fmu"


def test_a_problem_of_an_fmu_and_a_formula_remembers_how_it_was_made() -> None:
    problem = Problem.from_fmu(
        AT, "G[0,20] (speed <= 120)", inputs={"throttle": (0, 100, 4, "linear"), "brake": 10}, stop_time=20.0
    )
    assert problem.source is not None
    assert load_source(problem.source) == problem
    assert (problem.name, problem.info.name) == (problem.requirement.name, "ArchComp.AT")


@pytest.mark.parametrize(
    ("inputs", "named"),
    [
        ({"throttle": (0, 100, 4, "cubic")}, "cubic"),
        ({"throttle": (0, 1, 2, "linear", 5)}, "inputs.throttle"),
        ({"throtle": 1.0}, "'throttle'"),
    ],
)
def test_inputs_that_cannot_be_understood_are_named(inputs: dict[str, object], named: str) -> None:
    with pytest.raises(SpecError, match=named):
        Problem.from_fmu(AT, "G[0,20] (speed <= 120)", inputs=inputs)  # type: ignore[arg-type]


def test_the_fingerprint_is_of_everything_but_the_code() -> None:
    problem = lag_problem()
    assert pickle.loads(pickle.dumps(problem)).fingerprint == problem.fingerprint
    others = [
        lag_problem(name="OTHER"),
        lag_problem("G[0,10] (x <= 0.8)"),
        lag_problem(points=5),
        lag_problem(limit=2.0),
        lag_problem(parameters=[START]),
        replace(problem, parameters={"gain": 2.0}),
        replace(problem, experiment=replace(problem.experiment, step_size=0.05)),
    ]
    assert len({p.fingerprint for p in (problem, *others)}) == 8


def test_problems_that_differ_in_their_requirement_share_a_search_and_what_they_record() -> None:
    one, other = lag_problem(name="A"), lag_problem("G[0,10] (x <= 0.5)", name="B")
    other = replace(other, experiment=replace(other.experiment, outputs=("u", "x")))
    apart = lag_problem(points=5, name="C")
    groups = alike([one, apart, other])
    assert [[p.name for p in group] for group in groups] == [["A", "B"], ["C"]]
    assert [p.experiment.outputs for p in groups[0]] == [("x", "u")] * 2


def test_problems_that_are_simulated_otherwise_do_not_share_a_search() -> None:
    problem = lag_problem(name="A")
    others = [
        replace(lag_problem(name="B"), parameters={"gain": 2.0}),
        replace(lag_problem(name="C"), experiment=replace(problem.experiment, step_size=0.05)),
    ]
    assert len(alike([problem, *others])) == 3


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"experiment": Experiment(5.0, 0.1, ("x",))}, "LAG: stop_time is 10 s in the search space, but 5 s"),
        (
            {"space": SearchSpace((InputRange("v", 0, 1),), (), 10.0)},
            "no input 'v'",
        ),
        ({"parameters": {"gain": math.nan}}, "parameter 'gain': expected a finite number, got nan"),
        ({"parameters": {"gian": 2.0}}, "no variable 'gian'; did you mean 'gain'"),
        ({"experiment": Experiment(10.0, 0.1, ("X",))}, "no variable 'X'"),
        (
            {"requirement": Requirement("HIGH", parse("G (gain < 2)"))},
            "'gain', which is neither",
        ),
    ],
)
def test_parts_of_a_problem_that_do_not_fit_are_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        replace(lag_problem(), **wrong)
