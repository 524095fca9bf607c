import ast
import pickle
import re
from pathlib import Path

import pytest

from falsifier import errors
from falsifier.errors import (
    FalsifierError,
    SimulationError,
    SpecError,
    did_you_mean,
    in_section,
    naming,
    rejected,
    setting,
    written,
)

TREE = [v for v in vars(errors).values() if isinstance(v, type) and issubclass(v, FalsifierError)]


def test_every_error_is_of_one_tree_and_never_ends_like_a_falsification() -> None:
    assert len(TREE) >= 10
    assert {error.exit_code for error in TREE} == {2, 3}


def test_a_failed_simulation_travels_between_processes_with_what_it_knows() -> None:
    error = SimulationError("it crashed", status="crashed", time=1.5, log=("a", "b"))
    read = pickle.loads(pickle.dumps(error))
    assert (str(read), read.status, read.time, read.log) == ("it crashed", "crashed", 1.5, ("a", "b"))


def test_in_python_arguments_are_named() -> None:
    assert (setting("stop_time"), written("--llm NAME", "llm=NAME")) == ("stop_time", "llm=NAME")


def test_at_the_command_line_options_are_named(at_the_command_line: None) -> None:
    assert setting("stop_time", "SECONDS") == "--stop-time SECONDS"
    assert written("--llm NAME", "llm=NAME") == "--llm NAME"


@pytest.mark.parametrize(
    ("place", "message"), [("--set u", "--set u: is no number"), (None, "my.toml: inputs.u: is no number")]
)
def test_an_option_is_to_blame_in_place_of_the_spec_that_it_changes(place: str | None, message: str) -> None:
    with pytest.raises(SpecError) as caught, in_section("my.toml"), naming(place), in_section(key="inputs.u"):
        raise SpecError("is no number")
    assert str(caught.value) == message


# What reads and writes options; options of other programs; what is written for the command line.
_OF_OPTIONS = (
    *("problem/shorthand.py", "llm/failures.py", "llm/providers.py", "campaigns/archcomp.py"),
    *("counterexamples/export/components.py", "search/request.py"),
)


def test_only_the_command_line_speaks_of_options_without_asking_who_reads() -> None:
    package = Path(errors.__file__).parent
    found = []
    for file in package.rglob("*.py"):
        place = file.relative_to(package)
        if place.parts[0] in ("__init__.py", "cli", "views") or str(place) in _OF_OPTIONS:
            continue
        nodes = list(ast.walk(ast.parse(file.read_text())))
        calls = [n for n in nodes if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "written"]
        allowed = {part for call in calls for part in ast.walk(call)}
        allowed |= {n.value for n in nodes if isinstance(n, ast.Expr)}  # docstrings
        for node in nodes:
            text = node.value if isinstance(node, ast.Constant) and node not in allowed else ""
            if isinstance(text, str) and re.search(r"(?<![\w-])--[a-z]", text):
                found.append(f"{place}: {text}")
    assert not found


def test_known_names_are_listed_with_the_nearest_first() -> None:
    assert "'speed'" in did_you_mean("sped", ["rpm", "speed"])
    assert did_you_mean("po", ["pi", "plant"]).startswith("did you mean 'pi'")
    assert did_you_mean("foo", ["uniform", "cma"]) == "known: uniform, cma"
    far = did_you_mean("xyz", ["rpm", "speed"])
    assert "did you mean" not in far
    assert "rpm, speed" in far
    assert "none" in did_you_mean("x", [])
    assert "did you mean 'AT1'?" in did_you_mean("at1", ["CC", "AT", "AT1", "AT2"])
    assert "did you mean 'Throttle'?" in did_you_mean("THROTLE", ["brake", "Throttle"])
    many = did_you_mean("name7", [f"name{i}" for i in range(100)])
    assert "'name7'" in many
    assert "name39" in many and "name40" not in many


@pytest.mark.parametrize(
    ("message", "given", "text"),
    [
        ("Value error, low < high", [1, 0], "low < high"),
        ("Input should be 1 or 2", 3, "expected 1 or 2, got 3"),
        ("Field required", None, "a value is missing"),
        ("Input should be greater than 0", -5.0, "expected a number greater than 0, got -5.0"),
        ("Input should be a valid number, unable to parse string", "x", "expected a number, got 'x'"),
        ("Input should be a valid integer, got a number with", 2.5, "expected a whole number, got 2.5"),
    ],
)
def test_a_rejected_value_is_shown_where_only_the_expected_one_is_told(
    message: str, given: object, text: str
) -> None:
    assert rejected(message, given) == text
