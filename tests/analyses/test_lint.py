"""Findings on requirements that say nothing, and none on the bundled specs."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from falsifier.analyses.lint import lint, static_findings, unmoved_findings
from falsifier.cli.requirements import check
from falsifier.core.files import bundled
from falsifier.core.ranges import ParameterRange, Scale
from falsifier.errors import SpecError
from falsifier.problem.source import ProblemSource
from falsifier.testing import BIAS, Array, lag_problem
from tests.fmu.fixtures import altered
from tests.problem.support import AT, spec

SPEC = f"""
[model]
fmu = "{AT.as_posix()}"
interface = "co-simulation"
stop_time = 50.0
output_interval = 0.01
[inputs.throttle]
range = [0, 100]
control_points = 3
[inputs.brake]
value = 0
"""
# Specs whose simulations take milliseconds; those with hidden faults are among them.
CHEAP = ("AT", "CC", "ChargerHandshake", "HeaterLimpHome", "NN", "PulseMeter")
# By bundled spec: what is found, all of it true.
BUNDLED = {spec: [(f"{spec}6{part}", "implied") for part in "abc"] for spec in ("AT", "ATsplit")}
BUNDLED["ChargerHandshake"] = [("ChargerHandshake", "margin")]


@pytest.mark.parametrize(
    "name", sorted(p.stem for p in bundled("specs").glob("*.toml") if p.stem != "published")
)
def test_bundled_specs_raise_no_false_alarm(name: str) -> None:
    found = lint(name, simulations=2 if name in CHEAP else 0)
    assert [(f.requirement, f.kind) for f in found] == BUNDLED.get(name, [])
    assert all("6abc implies it" in f.text for f in found if f.kind == "implied")


FOUND = [
    ("G[0,20] (throttle <= 100)", "always", "G[0,20] (throttle <= 100)", "throttle in [0, 100]"),
    ("F[0,20] (throttle > 100.5)", "never", "F[0,20] (throttle > 100.5)", "every trajectory"),
    ("G (throttle > 120 -> speed <= 50)", "always", "G (throttle > 120 -> speed <= 50)", "search would be"),
    ("G[0,20] (throttle < 50 or brake > 1 or speed < 9)", "never", "brake > 1", "brake = 0"),
    ("G[0,20] (throttle < 50 or waitTicks > 3 or speed < 9)", "never", "waitTicks > 3", "waitTicks = 2"),
    ("G[0,0] (speed <= 120)", "window", "G[0,0] (speed <= 120)", "leave it out: speed <= 120"),
    *((right, "", "", "") for right in ("F[0,3] (throttle <= 3*speed)", "G[0,20] (wheel <= 200)")),
    ("G[0,20] (rpm <= 12) and G[0,10] (rpm <= 12)", "window", "G[0,10] (rpm <= 12)", "does not matter"),
    ("G[0,20] (speed <= 120 and speed <= 130)", "implied", "speed <= 130", "which implies it"),
    ("F[0,9] (speed >= 90) or F[0,5] (speed >= 90)", "window", "F[0,5] (speed >= 90)", "which it implies"),
    ("G[0,20] speed", "boolean", "speed", "so it means speed >= 0.5"),
    ("G[0,20] (speed - rpm <= 5)", "units", "speed - rpm <= 5", "only give both sides the same unit"),
    *((formula, "", "", "") for formula in ("G[0,20] (gear == 3)", "G[0,20] (gear != 3)", "F (gear == 3)")),
    ("F[0,9] (gear == 2.5)", "never", "gear == 2.5", "expected an integer for 'gear'"),
    ("G[0,9] (1.5 != gear or speed <= 9)", "always", "1.5 != gear", "always holds: expected an integer"),
    ("G (gear == 3 -> speed <= 9)", "margin", "", "write G (abs(gear - 3) <= 0.5 -> speed <= 9)"),
    ("G (gear != 3 or speed <= 9)", "margin", "", "write G (abs(gear - 3) > 0.5 or speed <= 9)"),
    ("G (abs(gear - 3) == 0 -> speed <= 9)", "margin", "", "write G (abs(abs(gear - 3) - 0) <= 0.5 -> speed"),
    *(
        (f"G ({side} -> speed <= 9)", "margin", "", "for x == 3 write abs(x - 3) <= 0.5")
        for side in ("rpm == 3", "gear / 2 == 1", "1 == sqrt(gear)", "0.5*gear == 1")
    ),
    *((formula, "", "", "") for formula in ("G (speed <= 9 -> gear == 3)", "G (gear == 3 and speed <= 9)")),
    ("G (gear == 3 -> F (gear > 3))", "", "", ""),
    ("G[0,60] (speed <= 5)", "invalid", "", "simulate longer"),
    ("G[0,20] (sped <= 5)", "invalid", "", "did you mean 'speed'"),
]  # fmt: skip


@pytest.mark.parametrize(("formula", "kind", "place", "words"), FOUND)
def test_what_says_nothing_is_found_with_its_place(
    tmp_path: Path, formula: str, kind: str, place: str, words: str
) -> None:
    wheel = "[parameters.wheel]\nrange = [0, 100]  # where it starts\n"
    found = lint(spec(tmp_path, f"{SPEC}{wheel}[requirements.R]\nformula = '{formula}'\n"))
    assert [(f.requirement, f.kind, f.part) for f in found] == ([("R", kind, place)] if kind else [])
    assert all(words in f"{f.text} {f.advice}" for f in found)


HEATER = f"""
[model]
fmu = "{bundled("fmus/HeaterLimpHome.fmu").as_posix()}"
interface = "co-simulation"
[inputs.disagreement]
range = [0, 10]
control_points = 2
"""


@pytest.mark.parametrize(
    ("formula", "told"),
    [("F[0,1] limp", "has few values, because limp is Boolean"), ("G[0,9] (limp -> power <= 30)", "")],
)
def test_a_requirement_about_booleans_alone_has_no_margin(tmp_path: Path, formula: str, told: str) -> None:
    path = spec(tmp_path, f"{HEATER}[requirements.R]\nformula = '{formula}'\n")
    found = [f for f in lint(path) if f.kind == "margin"]
    assert len(found) == bool(told)
    assert all(told in f.text and "temperature and power" in f.advice for f in found)
    assert ("Boolean" in CliRunner().invoke(check, [path]).output) == bool(told)


def test_a_searched_parameter_does_not_change_over_time() -> None:
    problem = lag_problem(parameters=[BIAS])
    assert not list(static_findings(problem))
    named = problem.with_requirement("G (bias <= 0.5)")  # without a window that could be left out
    found = [(f.kind, f.advice.partition(",")[0]) for f in static_findings(named)]
    assert found == [("window", "leave the operator out")]


def test_requirements_that_repeat_others_are_found(tmp_path: Path) -> None:
    formulas = {
        "A": "G[0,20] (speed <= 120)",
        "B": "G[0,20] (120 >= speed)",
        "C": "G[5,10] (speed <= 130)",
        "D": "G[0,20] (rpm <= 4750)",
    }
    text = SPEC + "".join(f"[requirements.{n}]\nformula = '{f}'\n" for n, f in formulas.items())
    found = lint(spec(tmp_path, text))
    assert [(f.requirement, f.kind) for f in found] == [
        ("B", "duplicate"), ("C", "implied"), ("C", "implied")
    ]  # fmt: skip
    # With another input range the same formula is another requirement.
    other = text.replace("[requirements.C]", "[requirements.C]\ninputs.throttle.range = [0, 50]")
    assert [f.requirement for f in lint(spec(tmp_path, other))] == ["B"]


def still(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Not even look at the input."""
    return {"x": np.sin(times)}


def test_what_no_input_moves_is_measured_and_says_so() -> None:
    (found,) = unmoved_findings([lag_problem(response=still)], 3)
    assert (found.kind, found.part) == ("unmoved", "")
    assert found.text.startswith("measured: 3 random simulations had the same x; the FMU does not declare")
    assert not list(unmoved_findings([lag_problem()], 3))
    assert not list(unmoved_findings([lag_problem(response=still)], 0))


def test_what_only_the_low_decades_move_is_seen() -> None:
    def low(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
        return {"x": np.full(times.shape, min(parameters["bias"], 1e-4))}

    counts: dict[Scale, int] = {"linear": 1, "log": 0}
    for scale, count in counts.items():
        bias = ParameterRange("bias", 1e-7, 1.0, scale=scale)
        problem = lag_problem("G[0,5] (x <= 9)", inputs=0, parameters=[bias], response=low)
        assert len(list(unmoved_findings([problem], 5))) == count


def test_what_the_fmu_declares_counts_unless_a_simulation_contradicts_it(tmp_path: Path) -> None:
    def declared_independent(content: bytes) -> bytes:
        outputs, rest = content.split(b"</Outputs>")
        return outputs.replace(b'" />', b'" dependencies="" />') + b"</Outputs>" + rest

    fmu = altered(AT, tmp_path / "car.fmu", declared_independent, ending="modelDescription.xml")
    text = (
        SPEC.replace(AT.as_posix(), fmu.as_posix()) + "[requirements.R]\nformula = 'G[0,20] (rpm <= 4750)'\n"
    )
    (declared,) = lint(spec(tmp_path, text))
    assert declared.text.startswith("declared: the FMU's structure has no path")
    assert lint(str(tmp_path / "my.toml"), simulations=2) == []


def test_a_spec_that_cannot_be_read_is_an_error(tmp_path: Path) -> None:
    text = SPEC.replace("[0, 100]", "[100, 0]") + "[requirements.R]\nformula = 'speed <= 1'\n"
    with pytest.raises(SpecError, match="low < high"):
        lint(spec(tmp_path, text))


@pytest.mark.parametrize(("formula", "kind"), [("G[0,10] (5 < 3)", "never"), ("5 > 3", "always")])
def test_a_formula_without_signals_is_decided(formula: str, kind: str) -> None:
    (found,) = lint(ProblemSource(target="AT1", stl=formula))
    assert (found.kind, found.text.endswith(", whatever happens")) == (kind, True)
