import pickle
from dataclasses import replace

import pytest

from falsifier.core.model import Experiment
from falsifier.errors import FormulaError, SpecError
from falsifier.problem.requirement import Requirement, parse_requirement
from falsifier.stl import parse
from falsifier.testing import lag_problem

INFO = lag_problem().info
EXPERIMENT = Experiment(10.0, 0.1, ("x",))


def test_outputs_and_inputs_may_be_named() -> None:
    assert parse_requirement("G[0,10] (x <= u)", INFO, EXPERIMENT).signals == ("x", "u")


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("G[0,10] (xx <= 1)", "'x'"),  # the nearest signal
        ("G[0,11] (x <= 1)", "11"),  # the window that reaches past the stop time
        ("G[0,0.25] (x <= 1)", "0.25"),  # a bound between two samples
        ("G[0,10] (x <= )", "x <= )"),  # where it cannot be read on
    ],
)
def test_what_cannot_be_judged_names_the_place(text: str, named: str) -> None:
    with pytest.raises(SpecError) as caught:
        parse_requirement(text, INFO, EXPERIMENT)
    assert named in str(caught.value)


def test_a_requirement_has_a_name_and_a_formula_or_its_text() -> None:
    low = Requirement("low", "G[0,10] (x < 1)", "stays low")
    assert low == Requirement("low", parse("G[0,10] (x < 1)"), "stays low") == pickle.loads(pickle.dumps(low))
    assert replace(low, name="other").formula == low.formula
    with pytest.raises(SpecError, match="expected a name"):
        Requirement(None, parse("G (x < 1)"))  # type: ignore[arg-type]
    with pytest.raises(SpecError, match="requirement 'low': expected a formula or its text, got 3"):
        Requirement("low", 3)  # type: ignore[arg-type]
    with pytest.raises(FormulaError, match="ends too early"):
        Requirement("low", "G (x <")


def test_values_are_shown_short() -> None:
    problem = lag_problem()
    assert repr(problem.requirement) == "Requirement('LAG', 'G[0,10] (x <= 0.9)')"
    assert repr(problem.requirement.formula) == "parse('G[0,10] (x <= 0.9)')"
    assert repr(problem.space) == "<SearchSpace: u in [-1, 1]; 10 s>"
    assert repr(problem) == "<Problem LAG of lag: G[0,10] (x <= 0.9), <SearchSpace: u in [-1, 1]; 10 s>>"
