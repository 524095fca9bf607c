"""Templates against formulas written by hand: the same robustness on random trajectories."""

import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.errors import SpecError
from falsifier.problem.shorthand import requirement_of
from falsifier.problem.spec import parse_spec
from falsifier.problem.templates import TEMPLATES
from falsifier.stl import Monitor, parse

STOP, STEP = 10.0, 0.1

WRITTEN: list[tuple[str, str]] = [
    ("settles signal=x reference=0.5 within=20% time=3", "G[3,10] (x >= 0.4 and x <= 0.6)"),
    (
        "settles signal=x reference=y within=0.5 time=1 after=2 stays=4",
        "G[2,2] G[1,5] (y - 0.5 <= x and x <= y + 0.5)",
    ),
    (
        "settles signal=x reference=y within=0.5 time=1 after='a > 0' stays=2",
        "G[0,6.9] ((a <= 0 and X (a > 0)) -> X G[1,1] G[0,2] (abs(x - y) <= 0.5))",
    ),
    ("overshoot signal=x reference=0.5 at_most=10%", "G[0,10] (x <= 0.55)"),
    (
        "overshoot signal=x reference=y at_most=10% direction=down after=3 duration=2",
        "G[3,5] (y - x <= 0.1*abs(y))",
    ),
    (
        "overshoot signal=x reference=y at_most=0.1 after='a > 0' duration=2 during=[1,4]",
        "G[1,4] ((not (a > 0) and X (a > 0)) -> X G[0,2] (x - y <= 0.1))",
    ),
    ("rise signal=x reference=0.5 time=2 after=1", "G[1,1] F[0,2] (x >= 0.45)"),
    (
        "rise signal=x reference=y reaches=50% direction=down time=2 after='a > 0'",
        "G[0,7.9] ((not (a > 0) and X (a > 0)) -> X F[0,2] (x <= 0.5*y))",
    ),
    ("response when='a > 0.5' then='x > 0' time=2", "G[0,8] ((a > 0.5) -> F[0,2] (x > 0))"),
    (
        "response when='a > 0.5' then='x > 0' time=2 stays=1 on=rising",
        "G[0,6.9] ((not (a > 0.5) and X (a > 0.5)) -> X F[0,2] G[0,1] (x > 0))",
    ),
    ("stays_within signal='x - y' low=-1 high=a", "G[0,10] (-1 <= x - y and x - y <= a)"),
    ("stays_within signal=x reference=y within=5% during=[2,3]", "G[2,3] (abs(x - y) <= 0.05*abs(y))"),
    ("stays_within signal=x high=1", "G[0,10] (x <= 1)"),
    (
        "never_together conditions=['x > 0','y > 0','a > 0']",
        "G[0,10] (not (x > 0 and y > 0) and not (y > 0 and a > 0) and not (x > 0 and a > 0))",
    ),
    (
        "dwell condition='a > 0' at_least=1 at_most=2",
        "G[0,7.9] ((not (a > 0) and X (a > 0)) -> X (G[0,1] (a > 0) and F[0,2] (a <= 0)))",
    ),
    (
        "dwell condition='F[0,1] (a > 0)' at_least=1",
        "G[0,7.9] ((not F[0,1] (a > 0) and X F[0,1] (a > 0)) -> X G[0,1] F[0,1] (a > 0))",
    ),
    ("ramp_limit signal=x limit=2 rate=y", "G[0,10] (-2 <= y and y <= 2)"),
    (
        "ramp_limit signal=x limit=2 over=0.5 range=[0,2] levels=2",
        "G[0,9.5] ((x <= 0.5 -> G[0,0.5] x <= 1.5) and (x >= 0.5 -> G[0,0.5] x >= -0.5) "
        "and (x <= 1.5 -> G[0,0.5] x <= 2.5) and (x >= 1.5 -> G[0,0.5] x >= 0.5))",
    ),
    ("order conditions=['x > 1','y > 1']", "G (y <= 1) or ((y <= 1 or x > 1) U (x > 1))"),
    (
        "order conditions=['x > 1','y > 1','a > 1'] during=[2,5]",
        "G[2,2] ((G[0,3] (y <= 1) or ((y <= 1 or x > 1) U[0,3] (x > 1))) "
        "and (G[0,3] (a <= 1) or ((a <= 1 or y > 1) U[0,3] (y > 1))))",
    ),
]


def trajectories(count: int) -> list[Trajectory]:
    rng = np.random.default_rng(7)
    times = np.linspace(0, STOP, 101)
    made = []
    for _ in range(count):
        columns = {name: np.repeat(rng.normal(size=21), 5)[:101] for name in "xya"}
        made.append(Trajectory(times, columns))
    return made


@pytest.mark.parametrize(("template", "formula"), WRITTEN)
def test_a_template_has_the_robustness_of_the_formula_by_hand(template: str, formula: str) -> None:
    text = requirement_of(template).expanded(STOP, STEP)
    ours, theirs = (Monitor(parse(each), STEP, 101) for each in (text, formula))
    assert str(parse(text)) == text
    values = [(ours.evaluate(t).robustness, theirs.evaluate(t).robustness) for t in trajectories(20)]
    assert [a for a, _ in values] == pytest.approx([b for _, b in values], abs=1e-12)
    assert len({round(a, 9) for a, _ in values}) > 2


@pytest.mark.parametrize(
    ("template", "stop", "step", "formula"),
    [
        ("settles signal=x reference=1 within=1 time=0.1 stays=0.2", 0.3, 0.1, "G[0.1,0.3]"),
        ("rise signal=x reference=1 time=0.2 after=0.1", 0.3, 0.1, "F[0.1,0.3]"),
        ("order conditions=['a','b'] during=[0.1,0.3]", 0.3, 0.1, "G[0.1,0.1] not (not a U[0,0.2] b)"),
        ("response when=a then=b time=86399.9", 86400, 0.1, "G[0,0.1] (a -> F[0,86399.9]"),
        ("settles signal=x reference=1 within=1 time=2.5e-9", 1e-6, 1e-10, "G[2.5e-09,1e-06]"),
    ],
)
def test_windows_have_no_digits_of_rounding(template: str, stop: float, step: float, formula: str) -> None:
    assert requirement_of(template).expanded(stop, step).startswith(formula)


def test_every_template_was_compared() -> None:
    assert {text.partition(" ")[0] for text, _ in WRITTEN} == set(TEMPLATES)


def ramp(rate: float) -> Trajectory:
    times = np.linspace(0, STOP, 101)
    return Trajectory(times, {"x": np.clip(rate * (times - 2), 0, 4)})


@pytest.mark.parametrize(("rate", "violated"), [(0.5, False), (1.0, False), (1.9, True), (8.0, True)])
def test_levels_never_call_a_slow_signal_fast(rate: float, *, violated: bool) -> None:
    """In 0.5 s 0.5 is allowed, and levels are 0.4 apart: from 1.8 per second on it is found for certain."""
    text = requirement_of("ramp_limit signal=x limit=1 over=0.5 range=[0,4] levels=10").expanded(STOP, STEP)
    assert Monitor(parse(text), STEP, 101).evaluate(ramp(rate)).violated is violated


@pytest.mark.parametrize(
    ("template", "message"),
    [
        ("settles signal=x reference=y within=1 time=1 after=a", "^stays: .* how long"),
        ("overshoot signal=x reference=y at_most=1 after=a", "^duration: .* how long"),
        ("settles signal=x reference=0 within=2% time=1", "2% of the reference 0 .* give a number"),
        ("settles signal=x reference=1 within=1 time=11", "at 10 s: shorten"),
        ("settles signal=x reference=1 within=1 time=3 after=8", "up to 11 s"),
        ("overshoot signal=x reference=1 at_most=99 after=11", "up to 11 s"),
        ("order conditions=['a','b'] during=[2,60]", "^during: .* 60 s.* end it at 10 s"),
        ("order conditions=['a','F[0,11] b']", "up to 11 s, .*: shorten the times"),
        ("rise signal=x reference=1 time=1 during=[0,1]", "^during: .* only if after"),
        ("response when=a then=x time=2 during=[0,9]", "^during: .* end it at 8 s"),
        ("dwell condition=a at_least=20", "up to 20.* s, .* 10 s: shorten"),
        ("stays_within signal=x low=0 during=[3,1]", "^during: .*start <= end"),
    ],
)
def test_what_does_not_fit_the_simulation_is_an_error(template: str, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        requirement_of(template).expanded(STOP, STEP)


@pytest.mark.parametrize(
    ("template", "message"),
    [
        ("settles reference=1 within=1 time=1", r"stl: signal: this key is missing: Signal"),
        ("settls signal=x", r"stl: template: no such template; did you mean 'settles'"),
        ("rise signal=x reference=1 reaches=3 time=1", "percentage of the reference"),
        ("rise signal=x reference=y direction=down time=1", "state reaches as well: '110%' of 20 is 22"),
        ("rise signal=x reference=-80 time=1", "a negative reference.* '90%' of it -72"),
        ("rise signal=x reference=1 time=1 tim=1", r"stl: tim: unknown key; did you mean 't"),
        ("never_together inputs=1 x=1", r"stl: inputs: it changes simulations"),
        ("never_together x=1", "stl: x: unknown key; known: description, during, conditions$"),
        ("stays_within signal=x", "expected low, high or both"),
        ("stays_within signal=x low=2 high=1", "low is 2, more than high, 1"),
        ("stays_within signal=x low=1 reference=2 within=1", "expected low, high or both"),
        ("never_together conditions=['a']", r"stl: conditions: expected at least 2 items, got 1"),
        ("dwell condition=a", "expected at_least"),
        ("dwell condition=a at_least=2 at_most=2", "less than at_most"),
        ("ramp_limit signal=x limit=1 over=1", "over and range together"),
        ("ramp_limit signal='x - y' limit=1", "has no der"),
        ("ramp_limit signal=x limit=1 over=1 range=[1,0]", "low < high"),
        ("stays_within signal='oil level' low=0", r"'level' .*\(position 5\)\n  oil .*\n.*\n.*double quotes"),
    ],
)
def test_wrong_arguments_are_named(template: str, message: str) -> None:
    with pytest.raises(SpecError, match=message) as raised:
        requirement_of(template)
    assert str(raised.value).startswith("stl: ")


def test_arguments_are_read_as_in_toml_or_as_text() -> None:
    text = "settles signal=y2-y1 reference=80 within=2% after='brake > 0.5' during=[0,5] stays=1 time=1"
    read = {"signal": "y2 - y1", "reference": 80.0, "within": "2%", "after": "brake > 0.5"}
    read |= {"during": (0.0, 5.0), "stays": 1.0}
    assert read.items() <= dict(requirement_of(text)).items()
    for written in ("""conditions=["a > 1", 'F[0,2] (b > 1)'] during=[0, 5]""", "conditions=['a','b']"):
        found = dict(requirement_of(f"never_together {written}"))["conditions"]
        assert found in (("a > 1", "F[0,2] (b > 1)"), ("a", "b"))
    for name in ("car.'front left'.v", "'\"G\"'"):
        found = requirement_of(f"rise signal={name} reference=1 time=1")
        assert parse(found.expanded(9.0)).signals == (name.strip("'\""),)


@pytest.mark.parametrize(
    "text", ["settles signal=x reference", "rise time=1 time=2", "rise signal='x", "rise signal=x,"]
)
def test_what_is_no_template_says_how_to_write_one(text: str) -> None:
    with pytest.raises(SpecError, match=r"stl: .*(key=value|a quote has no end)"):
        requirement_of(text)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("signal", "speed +", "position"),
        ("within", "x", "percentage such as"),
        ("within", -1, "at least 0"),
        ("within", "nan%", "or a percentage such as '2%', got 'nan%'"),
        ("time", -1, "greater than or equal to 0"),
        ("after", -1, "time of at least 0"),
        ("after", "x >", "position"),
        ("signal", float("inf"), "finite"),
    ],
)
def test_each_argument_is_checked_where_it_stands(key: str, value: object, message: str) -> None:
    good = {"template": "settles", "signal": "x", "reference": 1, "within": 1, "time": 1}
    data = {"model": {"fmu": "a.fmu"}, "requirements": {"R": good | {key: value}}}
    with pytest.raises(SpecError, match=message) as raised:
        parse_spec(data, file="my.toml")
    assert raised.value.key == f"requirements.R.{key}"
