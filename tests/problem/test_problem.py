import math
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import pytest

from falsifier.context.values import Context, Named
from falsifier.core.experiment import Experiment
from falsifier.core.files import bundled
from falsifier.core.ranges import InputRange, Scale
from falsifier.core.space import SearchSpace
from falsifier.errors import FormulaError, SpecError
from falsifier.problem.context import named_context, with_context
from falsifier.problem.loading import load_source
from falsifier.problem.problem import Problem, alike
from falsifier.problem.requirement import Requirement
from falsifier.problem.shorthand import changes_from_options
from falsifier.problem.source import ProblemSource
from falsifier.problem.spec import parse_spec
from falsifier.stl import parse
from falsifier.testing import START, lag_problem
from tests.problems import decades

AT = bundled("fmus") / "AT.fmu"


def test_a_problem_of_an_fmu_and_a_formula_remembers_how_it_was_made() -> None:
    problem = Problem.from_fmu(
        AT, "G[0,20] (speed <= 120)", inputs={"throttle": (0, 100, 4, "linear"), "brake": 10}, stop_time=20.0
    )
    assert problem.source is not None
    assert load_source(problem.source) == problem
    assert (problem.name, problem.info.name) == (problem.requirement.name, "ArchComp.AT")


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
    others += [decades(scale=scale) for scale in get_args(Scale)]
    assert len({p.fingerprint for p in (problem, *others)}) == 10


def test_problems_that_differ_in_their_requirement_share_a_search_and_what_they_record() -> None:
    one, other = lag_problem(name="A"), lag_problem("G[0,10] (x <= 0.5)", name="B")
    known, one = one, replace(one, experiment=replace(one.experiment, internals=("u", "gain")))
    assert one.fingerprint == known.fingerprint
    other = replace(other, experiment=replace(other.experiment, outputs=("u", "x")))
    apart = [
        lag_problem(points=5, name="C"),
        replace(lag_problem(name="D"), parameters={"gain": 2.0}),
        replace(lag_problem(name="E"), experiment=replace(one.experiment, step_size=0.05)),
    ]
    groups = alike([one, *apart, other])
    assert [[p.name for p in group] for group in groups] == [["A", "B"], ["C"], ["D"], ["E"]]
    assert [p.experiment.outputs for p in groups[0]] == [("x", "u")] * 2
    assert [p.experiment.internals for p in groups[0]] == [("gain",), ()]  # what one names is not beside


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"experiment": Experiment(5.0, 0.1, ("x",))}, "LAG: stop_time is 10 s in the search space, but 5 s"),
        ({"space": SearchSpace((InputRange("v", 0, 1),), (), 10.0)}, "no input 'v'"),
        ({"parameters": {"gain": math.nan}}, "parameter 'gain': expected a finite number, got nan"),
        ({"parameters": {"gian": 2.0}}, "no variable 'gian'; did you mean 'gain'"),
        ({"experiment": Experiment(10.0, 0.1, ("X",))}, "no variable 'X'"),
        ({"requirement": Requirement("HIGH", parse("G (gain < 2)"))}, "'gain', which is neither"),
    ],
)
def test_parts_of_a_problem_that_do_not_fit_are_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        replace(lag_problem(), **wrong)


CHANGED = ProblemSource(target="AT1", changes=changes_from_options(values=["brake=0"], stop_time=30.0))


def test_what_is_not_stated_stays_so_through_json() -> None:
    read = ProblemSource.model_validate_json(CHANGED.model_dump_json())
    assert read == CHANGED
    assert "output_interval" not in CHANGED.model_dump_json()
    problem, bundled = load_source(read), load_source(ProblemSource(target="AT1"))
    assert problem.experiment.stop_time == 30.0
    assert problem.experiment.output_interval == bundled.experiment.output_interval
    assert (dict(problem.parameters), problem.space.inputs) == ({"brake": 0.0}, bundled.space.inputs[:1])


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


SPEC = {
    "model": {"fmu": "a.fmu"},
    "context": {"files": ["plant.mo"], "fmu": True, "checked": ["plant.mo", "a.fmu: sources/a.c"]},
    "requirements": {"R": {"formula": "G (y < 1)"}},
}
LIMP = bundled("fmus").parent / "modelica" / "Faults" / "HeaterLimpHome.mo"


def test_the_spec_and_the_options_name_context(tmp_path: Path) -> None:
    spec, path = parse_spec(SPEC, file="a.toml"), tmp_path / "a.toml"
    plain = ProblemSource(target="a.toml")
    inside = str(tmp_path / "plant.mo")
    checked = (inside, "a.fmu: sources/a.c")
    assert named_context(plain, spec, path) == Named((inside,), fmu=True, checked=checked)
    more = plain.model_copy(update={"context": ("b.md", "b.md", "checked:b.md")})
    assert named_context(more, spec, path) == Named((inside, "b.md"), fmu=True, checked=(*checked, "b.md"))
    assert not named_context(plain.model_copy(update={"context": ("none",)}), spec, path)
    assert named_context(plain.model_copy(update={"context": ("none", "fmu")}), spec, path) == Named(fmu=True)


def test_files_are_read_only_when_asked_for() -> None:
    problem = load_source(ProblemSource(target="HeaterLimpHome", context=("no such file",)))
    assert problem.context == Context()
    with pytest.raises(SpecError, match="context no such file: cannot be read"):
        with_context(problem)
    read = with_context(load_source(ProblemSource(target="HeaterLimpHome", context=(str(LIMP),))))
    assert "disagreement > enterAbove (enterAbove = 6.8)" in read.context.of("disagreement")
    # What was read once, or recorded, is not read again.
    assert with_context(replace(problem, context=read.context)).context == read.context
