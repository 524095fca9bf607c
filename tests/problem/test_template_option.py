from pathlib import Path

import pytest

from falsifier.errors import SpecError
from falsifier.problem.loading import load_problem
from falsifier.problem.shorthand import changes_from_options
from falsifier.problem.source import ProblemSource
from falsifier.problem.template_option import formula_of_template
from tests.command import falsifier
from tests.problem.support import AT, GOOD, spec

GRID = "[model]\noutput_interval = 0.01"
RISE = "rise signal=speed reference=80 time=10"


def test_a_template_becomes_the_formula_of_its_simulation(tmp_path: Path) -> None:
    long = ProblemSource(target="AT1")
    assert formula_of_template(long, RISE) == "F[0,10] (speed >= 72)"
    dwell = "dwell condition='abs(gear - 3) <= 0.5' at_least=2.5"
    assert formula_of_template(long, dwell).startswith("G[0,47.49] ((not")
    changes = changes_from_options(inputs=["throttle=0:100"], stop_time=20.0)
    short = ProblemSource(target=str(AT), changes=changes)
    assert formula_of_template(short, "overshoot signal=speed reference=80 at_most=10%") == (
        "G[0,20] (speed - 80 <= 8)"
    )


@pytest.mark.parametrize(
    ("target", "text", "message"),
    [
        (
            "AT1",
            "rise signal=sped reference=80 time=10",
            r"--template: signal: unknown signal 'sped'; did you",
        ),
        ("AT1", "rise signal=speed reference=80 time=51", r"--template: time: needs values up to 51 s"),
        ("AT1", "rise signal=speed reference=80", r"--template: time: this key is missing"),
        ("AT1", "raise signal=speed", r"--template: template: no such template; did you mean 'rise'"),
        (str(AT), "rise signal=sped reference=80 time=10", r"--template: signal: unknown signal 'sped'"),
        (str(AT), "stays_within signal=speed", r"^--template: expected low, high or both"),
        ("AT1", "dwell condition=gear>2", r"^--template: expected at_least, at_most or both"),
        ("AT1", f"{RISE} stop_time=10", r"^--template: stop_time: .*other options \(--stop-time"),
        (str(AT), f"{RISE} description=fast", r"^--template: description: "),
        ("AT1", "ramp_limit signal=speed limit=9", r"rate: the model has no der\(speed\): .*; or over,"),
        ("python:tests.problems:easy", RISE, "made in Python"),
    ],
)
def test_errors_name_the_argument(target: str, text: str, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        formula_of_template(ProblemSource(target=target), text)


def test_what_a_requirement_overrides_stays(tmp_path: Path) -> None:
    text = GOOD.replace("[requirements.R]", "[requirements.R]\nstop_time = 30.0").replace(
        "AT.fmu", AT.as_posix()
    )
    source = ProblemSource(target=spec(tmp_path, text))
    assert formula_of_template(source, "stays_within signal=speed high=120") == "G[0,30] (speed <= 120)"


def test_on_the_command_line_the_formula_is_what_is_judged(tmp_path: Path) -> None:
    done = falsifier("simulate", "AT1", "--template", RISE, "--input", "throttle=100", cwd=tmp_path)
    assert done.code in (0, 1), done.err
    both = falsifier("run", "AT1", "--template", RISE, "--stl", "G (speed <= 1)", cwd=tmp_path)
    assert both.code == 2
    assert "--stl and --template" in both.err


def test_a_spec_with_a_template_is_a_problem_with_its_formula(folder: Path) -> None:
    section = 'template = "settles"\nsignal = "speed"\nreference = 80\nwithin = "2%"\ntime = 3'
    text = GOOD.replace('formula = "G[0,20] (speed <= 120)"', section)
    problem = load_problem(spec(folder, text))
    assert str(problem.requirement.formula) == "G[3,50] (abs(speed - 80) <= 1.6)"
    with pytest.raises(SpecError, match=r"my.toml: requirements\.R\.signal: unknown signal 'sped'; did you"):
        load_problem(spec(folder, text.replace('"speed"', '"sped"')))
    with pytest.raises(SpecError, match=r"my.toml: requirements\.R\.template: .*not a multiple"):
        load_problem(spec(folder, text.replace("time = 3", "time = 3.005").replace("[model]", GRID)))
    with pytest.raises(SpecError, match=r"my.toml: requirements\.R\.time: needs values up to 60 s"):
        load_problem(spec(folder, text.replace("time = 3", "time = 60")))


def test_of_several_requirements_that_simulate_differently_one_has_to_be_named(tmp_path: Path) -> None:
    text = GOOD.replace("[requirements.R]", "[requirements.R]\nstop_time = 30.0").replace(
        "AT.fmu", AT.as_posix()
    )
    more = f"{text}\n[requirements.S]\nformula = 'G[0,20] (speed <= 1)'\n"
    target = spec(tmp_path, more)
    within = "stays_within signal=speed high=120"
    with pytest.raises(SpecError, match=r"simulate in different ways.*:NAME, with one of R, S"):
        formula_of_template(ProblemSource(target=target), within)
    assert formula_of_template(ProblemSource(target=f"{target}:R"), within) == "G[0,30] (speed <= 120)"
