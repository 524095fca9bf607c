"""The public API as a user's type checker and editor see it."""

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

import falsifier
from falsifier.core.files import bundled
from falsifier.errors import FalsifierError
from tests.command import ROOT
from tests.problems import easy

AT = bundled("fmus") / "AT.fmu"
USER = ROOT / "tests" / "user_code.py"


def test_a_users_file_is_typed() -> None:
    """With the checkout's settings, which are strict, and its cache."""
    command = [sys.executable, "-m", "mypy", str(USER)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("name", dir(falsifier))
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(falsifier, name) is not None
    assert name in dir(falsifier)


# What a user without a type checker may write.
untyped: Any = falsifier
WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "a tuple of limits": (lambda: untyped.InputRange("u", 0.0, 1.0, free=(3, 1)), r"'u': free: .*Freedom"),
    "no formula": (lambda: untyped.parse(None), "text of a formula, got None"),
    "a number as description": (
        lambda: untyped.Requirement("R", untyped.parse("G[0,1] (x <= 1)"), description=5),
        "'R': description: expected text, got 5",
    ),
    "a monitor of text": (lambda: untyped.Monitor("..", 0.1, 11), r"use parse\('..'\)"),
    "one problem to resume": (lambda: untyped.resume("runs/x", problems=easy()), r"problems=\[problem\]"),
    "a list of inputs": (
        lambda: untyped.Problem.from_fmu("my.fmu", "G[0,1] (x <= 1)", inputs=["u"]),
        r"inputs: expected choices by name.*\['u'\]",
    ),
    "a number as FMU": (
        lambda: untyped.Problem.from_fmu(3, "x <= 1"),
        r"fmu: expected the path.*got 3 \(int",
    ),
    "a number to read": (lambda: untyped.read_info(3), r"path: expected the path of an FMU, got 3 \(int\)"),
    "a number as model": (lambda: untyped.FmuModel(3), r"path: expected a path, got 3 \(int\)"),
    "an FMU as package": (lambda: untyped.read_package(AT), r"AT\.fmu: expected the path of an \.ssp or"),
    "a number as target": (lambda: untyped.load_problem(3), "target: expected text, got 3"),
    "a number to check": (lambda: untyped.lint(3), "target: expected text, got 3"),
    "a number as run": (lambda: untyped.resume(3), r"directory: expected the directory of a run, got 3"),
    "a text as list": (lambda: untyped.load_problem("AT1", context="a.mo"), "context: expected a list of"),
    "a number as language model": (
        lambda: untyped.falsify(easy(), llm=3),
        "llm: expected a name, LLMSettings",
    ),
    "what templates lack": (
        lambda: untyped.Problem.from_fmu(AT, "rise signal=speed"),
        "^stl: reference: this key is missing",
    ),
    "no range": (
        lambda: untyped.Problem.from_fmu(AT, "G (speed <= 1)", inputs={"throttle": 3, "brake": 0}),
        r"a value keeps throttle and brake constant.* add inputs=\{'NAME': \(LOW, HIGH\)\}",
    ),
    "no requirement": (
        lambda: untyped.load_problem(AT),
        r"no requirement; use load_problem\('.*AT\.fmu', stl='G\[0,10\]",
    ),
    "a search without a requirement": (lambda: untyped.falsify(str(AT)), r"use load_problem\('.*', stl='G"),
    "several requirements": (lambda: untyped.falsify("AT"), r"falsify\(load_problems\('AT'\)\) falsifies"),
    "no target": (lambda: untyped.load_problem(""), "the target is empty; give a spec file"),
    "a folder": (lambda: untyped.load_problem("."), r"resume\('\.'\) continues it"),
    "no language model": (lambda: untyped.falsify(easy(), engine="hybrid"), r"name one \(llm=NAME\)"),
    "units that differ": (
        lambda: untyped.System({"a": AT}, {"a.throttle": "a.speed"}),
        "state factor and offset of this connection$",
    ),
    "a text to search": (
        lambda: untyped.Problem.from_fmu(AT, "G (speed <= 1)", parameters={"wheelRadius": "big"}),
        r"^parameters\.wheelRadius: .*: parameters=\{'wheelRadius': \(LOW, HIGH\)\}",
    ),
    "a name given twice": (
        lambda: untyped.Problem.from_fmu(
            AT, "G (speed <= 1)", inputs={"throttle": (0, 100)}, parameters={"throttle": (0, 1)}
        ),
        "throttle: given in inputs and in parameters; drop one",
    ),
    "a step longer than the interval": (
        lambda: untyped.Problem.from_fmu(AT, "speed <= 1", output_interval=0.01, step_size=0.02),
        "^output_interval: .* is not an integer multiple of step_size = 0.02 s; try step_size = 0.01",
    ),
    "a result to explain": (lambda: untyped.explain(easy(), 5), "explain: expected an evaluation"),
    "a number to shrink": (lambda: untyped.shrink(easy(), 5), "shrink: expected an evaluation"),
    "a device as directory": (
        lambda: untyped.falsify(easy(), budget=1, directory="/dev/null"),
        "/dev/null: no folder",
    ),
    "a name that is too long": (
        lambda: untyped.falsify(easy(), budget=1, directory="n" * 300),
        "no folder can be made here",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_of_a_wrong_type_is_named_with_what_was_expected(what: str) -> None:
    call, message = WRONG[what]
    with pytest.raises(FalsifierError, match=message):
        call()
