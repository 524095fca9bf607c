import zipfile
from pathlib import Path

import pytest

from falsifier.context import fmu_files
from falsifier.context.fmu_files import inside
from falsifier.errors import SpecError

DESCRIPTION = """<fmiModelDescription fmiVersion="3.0"><Annotations>
<Annotation type="org.x"><limit value="3"/>
</Annotation></Annotations><ModelVariables><Float64 name="u"><Annotations><Annotation type="t">deep
</Annotation></Annotations></Float64></ModelVariables></fmiModelDescription>"""
TERMINALS = """<fmiTerminalsAndIcons><Terminals><Terminal name="bus" matchingRule="plug" description="CAN">
<TerminalMemberVariable memberName="v" variableName="bus_v"/></Terminal></Terminals></fmiTerminalsAndIcons>"""


def write(path: Path, **more: str) -> Path:
    files = {
        "modelDescription.xml": DESCRIPTION,
        "terminalsAndIcons/terminalsAndIcons.xml": TERMINALS,
        "documentation/index.html": "<p>hello</p>",
        "documentation/logo.png": "x",
        "sources/model.c": "int a;",
        "sources/fmi2Functions.h": "int b;",
        "resources/map.txt": "1 2",
        "resources/map.csv": "1,2",
        "binaries/linux64/m.so": "x",
    } | more
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return path


def test_only_what_may_say_something_is_opened(tmp_path: Path) -> None:
    found = {name: content.decode() for name, content in inside(write(tmp_path / "m.fmu"))}
    assert sorted(found) == [
        "documentation/index.html",
        "modelDescription.xml",
        "resources/map.txt",
        "sources/model.c",
        "terminalsAndIcons/terminalsAndIcons.xml",
    ]
    assert found["terminalsAndIcons/terminalsAndIcons.xml"] == "terminal bus (plug), CAN: v = bus_v"
    assert found["modelDescription.xml"].splitlines() == [
        "annotation org.x: limit value=3",
        "u: annotation t:  deep",
    ]


def test_too_large_too_many_and_damaged_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SpecError, match=r"m\.fmu: documentation/a\.md has 5 MiB, more than 4"):
        list(inside(write(tmp_path / "m.fmu", **{"documentation/a.md": "x" * (5 << 20)})))
    with pytest.raises(SpecError, match=r"modelDescription\.xml: refused"):
        list(inside(write(tmp_path / "m.fmu", **{"modelDescription.xml": "<!DOCTYPE a><a/>"})))
    monkeypatch.setattr(fmu_files, "_MAX_FILES", 2)
    with pytest.raises(SpecError, match="5 documents and sources, more than 2"):
        list(inside(write(tmp_path / "m.fmu")))
