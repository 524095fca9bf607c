import copy
from pathlib import Path
from typing import Any

import pytest

from falsifier.errors import SpecError
from falsifier.problem.sections import ContextSection, InputSection, ParameterSection
from falsifier.problem.spec import overlay, parse_spec, read_spec

GOOD: dict[str, Any] = {
    "model": {"fmu": "a.fmu"},
    "inputs": {"u": {"range": [0, 1], "control_points": 3}},
    "requirements": {"R": {"formula": "G[0,1] (y <= 1)"}},
}
RISE = {"template": "rise", "signal": "y", "reference": 1.0, "time": 1.0}


def changed(path: str, value: object) -> dict[str, Any]:
    data = copy.deepcopy(GOOD)
    *parents, last = path.split(".")
    section = data
    for part in parents:
        section = section.setdefault(part, {})
    section[last] = value
    return data


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("inputs.u.rnage", [0, 1], r"inputs\.u\.rnage: unknown key; did you mean 'range'\?"),
        ("parameters.q", {"vlaue": 3}, r"parameters\.q: unknown key; did you mean 'value'\?.*\"q\.vlaue\""),
        ("model.stoptime", 3, r"model\.stoptime: unknown key; did you mean 'stop_time'\?"),
        ("requirement", {}, r"requirement: unknown key; did you mean 'requirements'\?"),
        ("inputs.u.range", [1, 0], r"inputs\.u\.range: expected \[low, high\] with low < high, got \[1, 0\]"),
        ("parameters.p.range", [3, 3], r".* got \[3, 3\]; one number alone keeps it constant$"),
        ("inputs.u.range", [0], r"inputs\.u\.range, entry 2: a value is missing"),
        ("inputs.u.interpolation", "cubic", r"inputs\.u\.interpolation: .*'constant', got 'cubic'$"),
        ("inputs.u.control_points", True, r"inputs\.u\.control_points: expected a number, got true$"),
        ("model.stop_time", "50", r"model\.stop_time: expected a number, got '50'$"),
        ("model.logging", 1, r"model\.logging: expected true or false, got 1$"),
        ("connections", {"a.b": {"from": "c.d", "factor": True}}, r"connections\.a\.b\.factor: .*got true$"),
        ("requirements.R", RISE | {"time": True}, r"requirements\.R\.time: expected a number, got true$"),
        ("inputs.u.control_points", 0, r"inputs\.u\.control_points: .*greater than or equal to 1, got 0$"),
        ("inputs.u.value", 1.0, r"inputs\.u: value keeps the input constant"),
        ("inputs.u.free", {"max_control_points": 3}, r"inputs\.u\.free\.min_interval: this key is missing"),
        ("model.interface", "cs", r"model\.interface: .*'co-simulation' or 'model-exchange', got 'cs'$"),
        ("parameters.p", {"range": [0, 1], "value": 2}, r"parameters\.p: value fixes the parameter"),
        ("parameters.p", {"scale": "log", "value": 2}, r".*\.p: value fixes .*, scale is how to search it"),
        ("parameters.p.scale", "ln", r"parameters\.p\.scale: expected 'linear' or 'log', got 'ln'"),
        ("inputs.u.scale", "log", r"inputs\.u\.scale: unknown key"),
        ("requirements", {}, r"requirements: "),
        ("requirements.R", {"tempalte": "x"}, r"requirements\.R\.tempalte: .* did you mean 'template'"),
        ("connections", {"a.b": {"source": "c.d"}}, r"connections\.a\.b\.source: unknown key; known: from,"),
        ("requirements.R", {"template": ["rise"]}, r"requirements\.R\.template: no such template; did you"),
        ("requirements.R.template", "settles", r"requirements\.R\.formula: .* has a template, too; give one"),
        ("requirements.R", "G (x <= 1)", r"requirements\.R: expected a table: \[requirements\.R\] with"),
        ("parameters.x[1]", [0, 1], r"parameters\.x\[1\]: expected a table: \[parameters\.\"x\[1\]\"\] with"),
        ("parameters.p", {"range": [0, 1], "control_points": 3}, r".*: only inputs .*: write \[inputs\.p\]"),
        ("parameters.p", {"range": [0, 1], "foo": 3}, r"parameters\.p\.foo: unknown key; known: range"),
        ("profiles.p.requirements.X.stop_time", 1, r"profiles: p: no requirement 'X'; known: "),
        ("profiles.p.inputs.u.hodl", 1, r"profiles\.p\.inputs\.u\.hodl: unknown key; did you mean 'hold'"),
    ],
)
def test_errors_name_file_key_and_cure(path: str, value: object, message: str) -> None:
    with pytest.raises(SpecError, match=rf"my\.toml: {message}"):
        parse_spec(changed(path, value), file="my.toml")


def test_a_file_without_requirements_is_told_what_is_missing() -> None:
    with pytest.raises(SpecError, match=r"my\.toml: requirements: this key is missing: What to falsify"):
        parse_spec({"model": GOOD["model"]}, file="my.toml")


def test_requirements_have_names() -> None:
    nameless = {"model": GOOD["model"], "requirements": {"": {"formula": "G (x <= 1)"}}}
    with pytest.raises(SpecError, match=r"my\.toml: requirements: a requirement has an empty name"):
        parse_spec(nameless, file="my.toml")


def test_unreadable_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"gone\.toml: no such spec file"):
        read_spec(tmp_path / "gone.toml")
    bad = tmp_path / "bad.toml"
    bad.write_text("[model\n")
    with pytest.raises(SpecError, match=r"bad\.toml: not valid TOML: .*line 1"):
        read_spec(bad)
    bad.write_text("[requirements.R1]\n[requirements.R1]\n")
    with pytest.raises(SpecError, match=r"Cannot declare \[requirements\.R1\] twice"):
        read_spec(bad)
    bad.write_text("[model]\n", encoding="utf-16")
    with pytest.raises(SpecError, match=r"bad\.toml: is written in UTF-16; .* save the file"):
        read_spec(bad)
    bad.write_bytes("# Größe\n".encode("latin-1"))
    with pytest.raises(SpecError, match=r"bad\.toml: cannot be read: .*save the file"):
        read_spec(bad)


@pytest.mark.parametrize(
    "text", ["{}b = 1", "[{}b]", "x = {{ y = 1, {}b = 1 }}", "x = [{{ 'a b'.{}b = 1 }}]"]
)
def test_keys_of_too_many_parts_are_refused_before_they_are_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.toml"
    for parts, message in ((501, "has a key of more than 500 parts"), (499, "unknown key")):
        path.write_text(text.format("a." * (parts - 1) + '"a" . '))
        with pytest.raises(SpecError, match=message):
            read_spec(path)


@pytest.mark.parametrize("text", ["model.fmu = {}", "components.a.fmu = {}", "context.files = [{}]"])
def test_what_can_be_no_path_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.toml"
    path.write_text(text.format(r'"a\u0000.fmu"') + "\nrequirements.R.formula = 'x <= 1'")
    with pytest.raises(SpecError, match=r"a\.toml: 'a\\x00\.fmu': no file has .* NUL"):
        read_spec(path)


def test_what_is_told_of_an_fmu_is_said_by_its_folders() -> None:
    """Those of ``context.files.inside``; its description, with annotations, is not among them."""
    said = ContextSection.model_fields["fmu"].description or ""
    assert "documentation, sources and texts" in said and "annotations" not in said


def test_a_narrowed_range_keeps_the_parameterization_and_another_one_is_fixed() -> None:
    base = InputSection.model_validate(
        {"range": [0, 1], "control_points": 3, "free": {"max_control_points": 9, "min_interval": 0.1}}
    )
    narrowed = overlay(base, InputSection.model_validate({"range": [0.4, 0.6]}))
    assert (narrowed.range, narrowed.control_points) == ((0.4, 0.6), 3)
    assert narrowed.free == base.free
    pieces = overlay(base, InputSection.model_validate({"control_points": 7, "interpolation": "constant"}))
    assert (pieces.range, pieces.control_points, pieces.free) == ((0, 1), 7, None)


def test_fixed_and_searched_replace_each_other() -> None:
    searched = InputSection.model_validate({"range": [0, 1], "control_points": 3})
    fixed = InputSection(value=0.5)
    assert overlay(searched, fixed) == fixed
    assert overlay(fixed, searched).value is None
    narrow = ParameterSection(range=(0, 1))
    assert overlay(ParameterSection(value=2.0), narrow) == overlay(narrow, ParameterSection()) == narrow
    assert overlay(ParameterSection(value=2.0), ParameterSection()) == ParameterSection(value=None)
    assert overlay(ParameterSection(scale="log"), narrow) == ParameterSection(range=(0, 1), scale="log")
    assert overlay(ParameterSection(range=(1, 2), scale="log"), ParameterSection(value=3.0)).scale is None
    bare = parse_spec(changed("parameters.mass", 3), file="my.toml")
    assert bare.parameters["mass"] == ParameterSection(value=3)


@pytest.mark.parametrize(
    ("requirement", "key"),
    [
        ({"template": "order", "conditions": ["a", "b"], "inputs": {"u": {"rang": [0, 1]}}}, "inputs.u.rang"),
        ({"formula": "G (x <= 1)", "inputs": {"u": {"range": [1, 0]}}}, "inputs.u.range"),
        ({"template": "order", "conditions": ["a", "b ="]}, "conditions, entry 2"),
        ({}, "formula"),
    ],
)
def test_keys_are_those_of_the_file_whatever_kind_a_requirement_is(
    requirement: dict[str, Any], key: str
) -> None:
    data = {"model": {"fmu": "a.fmu"}, "requirements": {"<formula>x": requirement}}
    with pytest.raises(SpecError) as raised:
        parse_spec(data, file="my.toml")
    assert raised.value.key == f"requirements.<formula>x.{key}"
