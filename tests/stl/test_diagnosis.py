from math import inf, nan

import numpy as np
import pytest

from falsifier.stl import Diagnosis, Monitor, parse
from falsifier.stl.diagnosis import valued
from falsifier.stl.expression import Name
from tests.stl.randoms import STEP, random_case
from tests.stl.test_monitor import trajectory


def diagnose(text: str, step: float = 1.0, **columns: list[float]) -> Diagnosis:
    t = trajectory(step, **columns)
    return Monitor(parse(text), step, len(t)).diagnose(t)


def test_the_path_of_a_nested_formula_in_words() -> None:
    gap = np.where(np.arange(501) < 123, 9.0, 7.0)
    gap[170] = 7.1
    found = diagnose("G[0,30] F[0,8] (y5 - y4 >= 8)", 0.1, y5=(gap + 1).tolist(), y4=[1.0] * 501)
    assert found.text == (
        "G over [0, 30] s was lowest at 17.1 s; F over [17.1, 25.1] s was highest at 17.1 s: "
        "y5 - y4 = 7 is below 8 by 1."
    )
    found = diagnose("G[0,15] F[0,8] (y5 - y4 >= 8)", 0.1, y5=(gap + 1).tolist(), y4=[1.0] * 501)
    assert found.text == (
        "G over [0, 15] s was lowest at 12.3 s; F over [12.3, 20.3] s was highest at 17 s: "
        "y5 - y4 = 7.1 is below 8 by 0.9."
    )
    assert [str(step.formula)[0] for step in found.path] == ["G", "F", "y"]
    assert [step.time for step in found.path] == pytest.approx([0.0, 12.3, 17.0])
    assert [step.window for step in found.path] == [(0.0, 15.0), pytest.approx((12.3, 20.3)), None]
    assert found.robustness == pytest.approx(-0.9)
    assert found.vacuities == ()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x <= 3", "x = 3 equals 3."),
        ("x + 1 >= y", "x + 1 = 4 exceeds y = 2 by 2."),
        ("x > 4", "x = 3 is below 4 by 1."),
        ("x == 4", "x = 3 differs from 4 by 1."),
        ("not (x <= 3)", "'not' fails: x = 3 equals 3."),
        ("not (x < 3)", "'not' holds: x = 3 equals 3."),
        ("x <= 5 and y <= 3", "the right side of 'and' decided: y = 2 is below 3 by 1."),
        ("x <= 9 and (y <= 9 and x <= 9) and y <= 3",
         "part 4 of 4 joined by 'and' decided: y = 2 is below 3 by 1."),
        ("x <= 1 or y <= 3 or (x <= 1 and y <= 1)",
         "part 2 of 3 joined by 'or' decided: y = 2 is below 3 by 1."),
        ("x <= 5 -> y <= 3", "the consequence of -> decided: y = 2 is below 3 by 1."),
        ("x <= 5 -> y >= 3", "the consequence of -> failed: y = 2 is below 3 by 1."),
        ("x <= 4 -> y >= 9", "the condition of -> decided: x = 3 is below 4 by 1."),
        ("x <= 5 <-> y <= 3", "the right side of '<->' decided: y = 2 is below 3 by 1."),
        ("X (x <= 3)", "the next recorded time is 1 s: x = 1 is below 3 by 2."),
        ("(x <= 9) U[0,1] (y >= 8)", "U over [0, 1] s was decided by its right side at 1 s: "
         "y = 7 is below 8 by 1."),
        ("(x <= 2) U (y >= 5)", "U over [0, 1] s was decided by its left side at 0 s: "
         "x = 3 exceeds 2 by 1."),
    ],
)  # fmt: skip
def test_each_operator_in_words(text: str, words: str) -> None:
    assert diagnose(text, x=[3.0, 1.0], y=[2.0, 7.0]).text == words


def test_a_condition_that_was_never_true_is_reported_as_vacuous() -> None:
    x, y = [1.0, 2.5, 2.0, 0.0], [5.0, 5.0, 5.0, 5.0]
    found = diagnose("G[0,3] (x >= 3 -> y <= 4)", x=x, y=y)
    assert found.robustness == 0.5
    (finding,) = found.vacuities
    assert (finding.window, finding.nearest, finding.margin, finding.only) == ((0.0, 3.0), 1.0, -0.5, True)
    assert found.text.endswith(
        "Vacuous: x >= 3 -> y <= 4 held over [0, 3] s only because its condition was never true; "
        "it came closest at 1 s, false by 0.5."
    )


def test_a_condition_that_was_never_true_is_not_the_only_reason_where_the_consequence_held() -> None:
    found = diagnose("G[0,1] (x >= 3 -> y <= 4)", x=[1.0, 2.0], y=[3.0, 4.0])
    assert not found.vacuities[0].only
    assert "The condition of x >= 3 -> y <= 4 was never true over [0, 1] s" in found.text
    once = diagnose("G[0,1] (x >= 3 -> y <= 4)", x=[3.0, 2.0], y=[3.0, 9.0])
    assert once.vacuities == (), "it was true once"


def test_a_condition_exactly_on_its_limit_is_true_if_its_comparison_says_so() -> None:
    found = diagnose("G[0,1] (x > 0 -> y <= 4)", x=[0.0, 0.0], y=[9.0, 9.0])
    assert found.vacuities[0].only and found.text.endswith("it came closest at 0 s, exactly on its limit.")
    assert diagnose("G[0,1] (x >= 0 -> y <= 4)", x=[0.0, 0.0], y=[9.0, 9.0]).robustness < 0


def test_only_the_times_at_which_an_implication_is_asked_count() -> None:
    assert diagnose("G[1,2] (x >= 3 -> y <= 4)", x=[9.0, 1.0, 1.0, 9.0], y=[9.0] * 4).vacuities[0].only
    single = diagnose("(G[0,1] (x <= 3)) -> y <= 4", x=[1.0, 4.0], y=[9.0, 9.0])
    assert single.vacuities[0].text == (
        "Vacuous: G[0,1] (x <= 3) -> y <= 4 held at 0 s only because its condition was not true; "
        "it was false by 1."
    )


def test_diagnoses_end_where_verdicts_do() -> None:
    for seed in range(40_000, 40_300):
        formula, t = random_case(seed)
        monitor = Monitor(formula, STEP, len(t))
        found, verdict = monitor.diagnose(t), monitor.evaluate(t)
        assert (found.robustness, found.critical_time) == (verdict.robustness, verdict.critical_time)
        assert str(found.path[-1].formula) == verdict.predicate
        assert abs(found.path[-1].value) == pytest.approx(abs(verdict.robustness))


def test_numbers_that_differ_read_as_different() -> None:
    assert diagnose("x <= 87.5", x=[87.5 + 1.08e-5]).text == "x = 87.500011 exceeds 87.5 by 1.08e-05."
    assert diagnose("x <= 87.5", x=[87.4]).text == "x = 87.4 is below 87.5 by 0.1."


@pytest.mark.parametrize(("value", "margin"), [(3.0, inf), (inf, inf), (inf, 1.0), (3.0, nan), (0.0, 1.0)])
def test_values_that_are_not_finite_are_told_too(value: float, margin: float) -> None:
    assert valued(Name("x"), {"x": value}, margin) == f"x = {value:g}"
