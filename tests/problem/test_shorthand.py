from itertools import chain
from typing import Any

import click
import numpy as np
import pytest

from falsifier.cli.options import problem_source, requirement_options
from falsifier.errors import SpecError
from falsifier.problem.sections import InputSection, ParameterSection
from falsifier.problem.shorthand import changes_from, changes_from_options, options_from, without_option


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("throttle=", "expected NAME="),
        ("=0:1", "expected NAME="),
        ("throttle=0:", "expected NAME=LOW:HIGH"),
        ("throttle=3", "to keep it constant: --set throttle=VALUE"),
        ("throttle=-5..5", "expected NAME=LOW:HIGH"),
        ("throttle=0:1:many", "expected NAME=LOW:HIGH"),
        ("throttle=0:1:3:linear:5", "expected NAME=LOW:HIGH"),
        ("mass=1:9:log:pchip", "or of a parameter NAME=LOW:HIGH:log"),
        ("throttle=0:1:3:cubic", "expected 'pchip', 'linear' or 'constant', got 'cubic'"),
        ("throttle=1:0:3", "low < high"),
    ],
)
def test_options_that_cannot_be_read_are_named(option: str, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        changes_from_options(ranges=[option])


@pytest.mark.parametrize(
    "options",
    [
        {"ranges": ["u=0:1:3"], "stop_time": 5.0},
        {"ranges": ["u=-0.1:0.3:3:linear", "w", "q=0:0.1", "m=Off:Lock:3"], "values": ["p=1e-07", "v=On"]},
        {"ranges": ["p=1e-06:0.1:log", "q=0:1", "r=1:2:linear"], "values": ["s=1"]},
        {"interface": "model-exchange", "output_interval": 0.01},
        {"allow": ["write:/tmp", "programs"], "deny": ["network"]},
        {},
    ],
)
def test_changes_can_be_said_as_options_again(options: dict[str, Any]) -> None:
    changes = changes_from_options(**options)
    command = click.command()(requirement_options(lambda **_: None))
    given = command.make_context("x", ["AT1", *chain.from_iterable(options_from(changes))]).params
    assert problem_source(given).changes == changes
    assert given == {}, "options that are declared, and not taken: add them to KEYS_WITH_OPTION"


def test_values_of_python_mean_the_same_as_options() -> None:
    given = changes_from(
        inputs={"b": (0, 2), "c": (0, 2, 7, "linear"), "d": None, "q": (0, 1)}, parameters={"p": 3, "a": 1}
    )
    said = changes_from_options(ranges=["b=0:2", "c=0:2:7:linear", "d", "q=0:1"], values=["p=3", "a=1"])
    assert given == said


def test_a_section_says_all_that_a_spec_can() -> None:
    section = InputSection(control_points=3, hold=0.05)
    changes = changes_from(inputs={"u": section}, parameters={})
    assert changes.inputs["u"] == section
    assert without_option(changes) == ["inputs.u.control_points", "inputs.u.hold"]
    scaled = changes_from(parameters={"p": ParameterSection(scale="log"), "q": (1, 2, "log")})
    assert without_option(scaled) == ["parameters.p.scale"]
    assert options_from(scaled)[1] == ("--search", "q=1:2:log")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"ranges": ["u=0:1:3", "v", "u"]}, "--search u: given twice"),
        ({"values": ["p=1", "p=2"]}, "--set p: given twice"),
        ({"values": ["p=1"], "ranges": ["p=0:1"]}, "p: --set keeps it constant, --search varies it"),
        ({"values": ["p=1"], "ranges": ["p=1:2:log"]}, "p: --set keeps it constant, --search varies it"),
        ({"ranges": ["p=1:0:log"]}, r"--search p: expected \[low, high\] with low < high"),
    ],
)
def test_a_name_is_given_once(options: dict[str, Any], message: str, at_the_command_line: None) -> None:
    with pytest.raises(SpecError, match=message):
        changes_from_options(**options)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"inputs": {1: (0, 1)}}, "^inputs: names must be text, got the key 1"),
        ({"parameters": {1: 2}}, "^parameters: names must be text, got the key 1"),
        ({"inputs": {"u": {"range": (0, 1)}}}, r"InputSection or None, got \{'range': \(0, 1\)\}"),
        ({"inputs": {"u": {0, 100}}}, "inputs.u: .*got "),
        ({"inputs": {"u": (1,)}}, "inputs.u: "),
        ({"inputs": {"u": (0, 1, 2, "linear", 4)}}, "inputs.u: "),
        ({"parameters": {"p": (0, 1, 2)}}, "parameters.p.scale: expected 'linear' or 'log', got 2"),
        ({"parameters": {"p": (1,)}}, r"parameters.p: .*ParameterSection or None, got \(1,\)"),
        ({"inputs": {"u": (0, [1])}}, r"inputs.u.range, entry 2: expected a number or text, got \[1\]"),
        ({"parameters": {"p": 10**400}}, "parameters.p.value: expected a finite number, got 10"),
    ],
)
def test_what_is_no_choice_is_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        changes_from(**given)


def test_what_is_no_duration_is_named_by_its_option(at_the_command_line: None) -> None:
    with pytest.raises(SpecError, match=r"^--stop-time: expected a number greater than 0"):
        changes_from_options(stop_time=-5.0)


def test_numbers_of_numpy_are_numbers() -> None:
    given = changes_from(inputs={"u": np.array([0, 100]), "v": np.int64(3)})  # type: ignore[dict-item]
    assert given == changes_from(inputs={"u": (0, 100), "v": 3})
