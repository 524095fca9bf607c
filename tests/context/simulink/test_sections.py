import zipfile
from pathlib import Path

import pytest

from falsifier.context.simulink import sections
from falsifier.context.simulink.sections import (
    as_tree,
    is_text_package,
    parse_mdl,
    read_parts,
    text_parts,
)
from falsifier.errors import FalsifierError, ModelError, SpecError
from tests.fixtures import simulink


def test_sections_values_and_pieces_of_text() -> None:
    text = 'Model {\n  Name "a \\"b\\"\\n"\n  "c"\n  Points [1, 2]\n  Simulink.X {\n    $Id 2\n  }\n}\n'
    model = parse_mdl(text, "a.mdl").children[0]
    assert model.values == {"Name": 'a "b"\nc', "Points": "[1, 2]"}
    assert (model.children[0].kind, model.children[0].values) == ("Simulink.X", {"$Id": "2"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('Model {\n  Name "a"\n', "the section Model of line 1 is not closed"),
        ("}\n", "line 1: a section is closed that was not opened"),
        ('Model {\n  Name "a\n}\n', "line 2: expected NAME VALUE"),
        ("Model {\n  ???\n}\n", "line 2: expected NAME VALUE"),
        ('Model {\n  "piece"\n}\n', "line 2: expected"),
        ("A {\n" * 300, "nested more than 200 deep"),
    ],
)
def test_errors_name_the_line(text: str, message: str) -> None:
    with pytest.raises(SpecError, match=f"a.mdl: .*{message}".replace("?", r"\?")):
        parse_mdl(text, "a.mdl")


def test_text_parts_are_those_of_the_package() -> None:
    text = simulink.text_package()
    assert is_text_package(text)
    assert not is_text_package(simulink.MDL)
    parts = text_parts(text)
    assert parts["simulink/systems/system_root.xml"].decode() == simulink.ROOT.rstrip()
    assert "metadata/thumbnail.png" not in parts  # binary


def tree_of(path: Path) -> None:
    as_tree(read_parts(path), path.name)


def test_only_parts_that_describe_the_model_are_read(tmp_path: Path) -> None:
    found = read_parts(simulink.write_slx(tmp_path / "a.slx"))
    assert "simulink/blockdiagram.xml" in found
    assert "metadata/thumbnail.png" not in found


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("simulink/systems/system_4.xml", "<System><Block", "system_4.xml: not well-formed XML"),
        ("simulink/systems/system_4.xml", None, "the part system_4.xml is missing"),
        ("simulink/blockdiagram.xml", None, "the part simulink/blockdiagram.xml is missing"),
        (
            "simulink/systems/system_4.xml",
            '<System><System Ref="system_root"/></System>',
            "which contains it",
        ),
        ("simulink/stateflow/chart_14.xml", '<!DOCTYPE x><chart id="14"/>', "chart_14.xml: refused"),
    ],
)
def test_errors_name_the_part(tmp_path: Path, name: str, text: str | None, message: str) -> None:
    changed = simulink.newer_parts()
    if text is None:
        del changed[name]
    else:
        changed[name] = text
    with pytest.raises(SpecError, match=f"a.slx: .*{message}"):
        tree_of(simulink.write_slx(tmp_path / "a.slx", changed))


def test_damaged_archives_are_named(tmp_path: Path) -> None:
    path = simulink.write_slx(tmp_path / "a.slx")
    whole = path.read_bytes()
    path.write_bytes(whole[:200])
    with pytest.raises(ModelError, match="not a readable Simulink file"):
        tree_of(path)
    start = whole.index(b"simulink/systems/system_root.xml") + 32
    path.write_bytes(whole[:start] + bytes(40) + whole[start + 40 :])
    with pytest.raises(FalsifierError, match=r"system_root\.xml is damaged"):
        tree_of(path)


def test_bombs_and_parts_that_are_too_large_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sections, "_MAX_PART_BYTES", 1 << 20)
    with zipfile.ZipFile(tmp_path / "a.slx", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("simulink/blockdiagram.xml", bytes(3 << 20))
    with pytest.raises(SpecError, match=r"blockdiagram\.xml has 3 MiB, more than 1"):
        tree_of(tmp_path / "a.slx")


@pytest.mark.parametrize(
    ("limit", "message"),
    [("_MAX_SECTIONS", "more than 99 sections"), ("_MAX_REFERENCES", "more than 99 times")],
)
def test_parts_that_multiply_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, message: str
) -> None:
    monkeypatch.setattr(sections, limit, 99)
    twice = '<System><System Ref="system_{0}"/><System Ref="system_{0}"/></System>'
    systems = {f"simulink/systems/system_{i}.xml": twice.format(i + 1) for i in range(20)}
    last = {"simulink/systems/system_20.xml": "<System/>"}
    first = {"simulink/blockdiagram.xml": '<ModelInformation><System Ref="system_0"/></ModelInformation>'}
    with pytest.raises(SpecError, match=message):
        tree_of(simulink.write_slx(tmp_path / "a.slx", {**first, **systems, **last}))
