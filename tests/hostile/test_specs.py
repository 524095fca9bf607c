"""Spec files, formulas and model descriptions of any size and content: one clear error, and soon."""

import re
from collections.abc import Callable
from pathlib import Path
from random import Random
from xml.etree import ElementTree

import pytest

from falsifier.core.files import bundled
from falsifier.errors import FalsifierError, FormulaError, ModelError, SpecError
from falsifier.fmu.description.archive import read_entry
from falsifier.fmu.description.model_description import Description, parse, read_description
from falsifier.problem.loading import load_problem
from falsifier.problem.spec import read_spec
from falsifier.stl import parse as parse_formula
from tests.fixtures.archives import packed

FMU = bundled("fmus") / "AT.fmu"
MINIMAL = f"""
[model]
fmu = {str(FMU)!r}
interface = "co-simulation"
MORE
[inputs.throttle]
range = [0, 100]
INPUT
[requirements.R]
formula = 'G[0,1] (speed <= 120)'
"""


def clear(error: pytest.ExceptionInfo[FalsifierError]) -> str:
    text = str(error.value)
    assert 0 < len(text) <= 2100 and max(map(len, text.splitlines())) <= 2100
    return text


@pytest.mark.parametrize(
    ("model", "given", "named"),
    [
        ("stop_time = 1\noutput_interval = 1e-12", "control_points = 3", "model.output_interval"),
        ("stop_time = 1\nstep_size = 1e-12", "control_points = 3", "model.step_size"),
        (
            "stop_time = 1e-320",
            "control_points = 3",
            "model.stop_time: .* so short .* smallest value is 1e-10",
        ),
        ("stop_time = 1", "control_points = 1000000000", "inputs.throttle.control_points"),
        ("stop_time = 1", "control_points = 3\nhold = 1e-9", "inputs.throttle.hold"),
        (
            "stop_time = 1",
            "control_points = 3\nfree = { max_control_points = 1000000000, min_interval = 0.1 }",
            "max_control_points",
        ),
    ],
)
def test_sizes_that_no_machine_has_are_refused(model: str, given: str, named: str, tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(MINIMAL.replace("MORE", model).replace("INPUT", given))
    with pytest.raises(SpecError, match=named) as error:
        load_problem(str(path))
    clear(error)


@pytest.mark.parametrize(
    "content",
    [
        "a = " + "[" * 100_000,
        "a = " + "{x=" * 50_000,
        "a." * 50_000 + "b = 1",
        f"a = {'9' * 5000}",
        f"[model]\nfmu = {'9' * 4000}",
        f"{'k' * 2_000_000} = 1",
        f"[model]\n{'k' * 200_000} = 1",
        f"[inputs.{'k' * 200_000}]\nrange = [1, 0]",
        f"[requirements.{'k' * 200_000}]\nformula = 1",
        "\0",
    ],
    ids=range(10),
)
def test_a_spec_of_any_content_is_an_error_of_one_page(content: str, tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(content)
    with pytest.raises(SpecError) as error:
        read_spec(path)
    assert clear(error).startswith(str(path))
    assert not re.search("sys\\.|recursion", clear(error)), "no word of what reads it"


@pytest.mark.parametrize(
    "formula",
    [
        " and ".join(["x <= 1"] * 100_000),
        "(" * 1_000_000,
        "(" * 9_000 + "x" + ")" * 9_000,
        " + ".join(["x"] * 4_000) + " <= 1",
        " -> ".join(["x <= 1"] * 1_500),
        "not " * 4_000 + "x",
        f"{'x' * 15_000} y",
        f'"{"x" * 2_000_000}" <= 1',
        f"x <= {'9' * 15_000}",
        f"G[0,{'9' * 15_000}] x",
    ],
    ids=range(10),
)
def test_a_formula_of_any_length_is_an_error_of_one_page(formula: str) -> None:
    with pytest.raises(FormulaError) as error:
        parse_formula(formula)
    clear(error)


# -- model descriptions -----------------------------------------------------------------------------------

FMI2 = """<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g"><CoSimulation modelIdentifier="m"/>
<ModelVariables>{}</ModelVariables></fmiModelDescription>"""
FMI3 = """<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="g">
<CoSimulation modelIdentifier="m"/><ModelVariables>{}</ModelVariables></fmiModelDescription>"""


def scalar(name: str = "x", reference: str = "1", typed: str = "<Real/>") -> str:
    return f'<ScalarVariable name="{name}" valueReference="{reference}">{typed}</ScalarVariable>'


def described(text: str) -> Description:
    return parse(ElementTree.fromstring(text), name="m.fmu")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (FMI2.format(scalar(typed="")), "'x': it has no type"),
        (FMI2.format(scalar() * 2), "two variables are named 'x'"),
        (FMI2.format(scalar(reference="99999999999")), "does not fit 32 bits"),
        (FMI2.format(scalar(reference="-1")), "does not fit 32 bits"),
        (FMI2.format(scalar(reference="9" * 5000)), "does not follow FMI 2.0"),
        (FMI2.format(scalar(name="x" * 20_000_000)), "more than 10000 characters"),
        (FMI2.replace('Name="m"', f'Name="{"m" * 20_000_000}"').format(""), "more than 10000 characters"),
        (FMI2.replace('ier="m"', f'ier="{"m" * 20_000_000}"').format(""), "more than 10000 characters"),
        (FMI2.format(scalar(typed='<Real min="low"/>')), "min = 'low': expected a number"),
        (
            FMI3.format('<Float64 name="x" valueReference="1"><Dimension start="4000000000"/></Float64>'),
            "4000000000 elements",
        ),
        (
            FMI3.format('<Float64 name="x" valueReference="1"><Dimension start="-3"/></Float64>'),
            "-3 elements",
        ),
    ],
    ids=range(11),
)
def test_descriptions_that_no_model_has_are_refused(text: str, message: str) -> None:
    with pytest.raises(ModelError, match=message) as error:
        described(text)
    assert clear(error).startswith("m.fmu: ")


def test_descriptions_of_any_size_are_refused_before_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("falsifier.fmu.description.archive._MAX_TEXT_BYTES", 2 << 20)
    path = packed(tmp_path / "a.fmu", {"modelDescription.xml": b"<" * (3 << 20)})
    with pytest.raises(ModelError, match="has 3 MiB, more than 2") as error:
        read_description(path)
    clear(error)


def flipped(content: bytes, random: Random) -> bytes:
    changed = bytearray(content)
    for _ in range(random.choice((1, 10, 100))):
        changed[random.randrange(len(changed))] = random.randrange(256)
    return bytes(changed)


def without_attribute(content: bytes, random: Random) -> bytes:
    words = content.split(b" ")
    del words[random.randrange(1, len(words) - 1)]
    return b" ".join(words)


def larger(content: bytes, random: Random) -> bytes:
    at = random.choice([i for i, byte in enumerate(content) if 48 <= byte <= 57])
    return content[:at] + b"9" * random.choice((3, 12, 400)) + content[at:]


@pytest.mark.parametrize("damage", [flipped, without_attribute, larger])
def test_damaged_descriptions_are_read_or_named(
    damage: Callable[[bytes, Random], bytes], tmp_path: Path
) -> None:
    whole = read_entry(FMU, "modelDescription.xml")
    random, path = Random(8), tmp_path / "a.fmu"
    for _ in range(100):
        packed(path, {"modelDescription.xml": damage(whole, random)})
        try:
            read_description(path)
        except ModelError as error:
            assert str(error).startswith(str(path))
