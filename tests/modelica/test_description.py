"""modelDescription.xml, the contents of the archives, reproducible builds."""

import hashlib
import json
import subprocess
import tomllib
import zipfile
from pathlib import Path

import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu

from tests.modelica.conftest import Build, exporter_python, run_exporter
from tests.modelica.exporter import ROOT
from tests.patience import HANG

FMUS = sorted((ROOT / "fmus").glob("*.fmu"))
AT = ROOT / "fmus" / "AT.fmu"


@pytest.mark.parametrize("path", FMUS, ids=lambda path: path.name)
def test_the_validator_has_no_complaint(path: Path) -> None:
    assert validate_fmu(str(path)) == []
    description = read_model_description(str(path), validate=True)
    assert description.coSimulation is not None
    assert description.modelExchange is not None
    assert len(description.description.split()) > 8
    for variable in description.modelVariables:
        if variable.causality in ("input", "output", "parameter"):
            assert variable.description, variable.name
        if variable.causality == "input" and variable.type in ("Real", "Float64", "Integer", "Int32"):
            assert variable.min is not None and variable.max is not None and variable.start is not None
        if variable.causality == "input" and variable.type in ("Real", "Float64"):
            assert variable.unit, variable.name  # the unit 1, if it has no dimension


@pytest.mark.parametrize(
    ("model", "fmi"),
    [("Decay", 2), ("Ball", 2), ("Counter", 2), ("Arrays", 2), ("Starts", 2), ("Switched", 3), ("Arrays", 3)],
)
def test_the_validator_accepts_every_kind_of_variable(build: Build, model: str, fmi: int) -> None:
    assert validate_fmu(str(build(model, fmi=fmi))) == []


def test_hashes_are_listed() -> None:
    lines = (ROOT / "fmus" / "SHA256SUMS").read_text().splitlines()
    expected = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}" for path in FMUS]
    assert lines == expected, "make fmus writes them"


def test_every_fmu_of_the_table_is_there() -> None:
    table = tomllib.loads((ROOT / "modelica" / "export" / "systems.toml").read_text())
    assert sorted(entry["file"] for entry in table.values()) == [path.name for path in FMUS], "state each"


def test_parameters_are_fixed_tunable_or_constant(build: Build) -> None:
    found = {}
    for model in ("Decay", "Counter", "Arrays", "Inherited"):
        for v in read_model_description(str(build(model))).modelVariables:
            found[model, v.name] = (v.causality, v.variability)
    assert found["Decay", "k"] == ("parameter", "tunable")
    assert found["Decay", "x0"] == ("parameter", "fixed")
    assert found["Decay", "twice"] == ("calculatedParameter", "tunable")
    assert found["Inherited", "gain"] == ("local", "constant")  # final
    assert found["Counter", "period"] == ("parameter", "fixed")
    assert found["Arrays", "n"] == ("local", "constant")  # decides sizes
    assert found["Counter", "held"] == ("output", "discrete")


def test_sources_and_binaries_for_three_platforms() -> None:
    names = set(zipfile.ZipFile(AT).namelist())
    assert {"binaries/linux64/AT.so", "binaries/win64/AT.dll", "binaries/darwin64/AT.dylib"} <= names
    assert {"sources/model.c", "sources/fmi2.c", "sources/integrate.c", "sources/sizes.h"} <= names
    names = set(zipfile.ZipFile(ROOT / "fmus" / "AT_fmi3.fmu").namelist())
    assert "binaries/x86_64-linux/AT.so" in names
    assert "sources/buildDescription.xml" in names


def test_the_same_sources_give_the_same_bytes(build: Build, tmp_path: Path) -> None:
    again = tmp_path / "again.fmu"
    source = str(ROOT / "tests" / "modelica" / "Features")
    arguments = ["--source", source, "--output", str(again), "--platform", "linux64"]
    done = run_exporter("Features.Decay", *arguments, fresh=True)  # sets have another order
    assert done.returncode == 0, done.stderr
    assert again.read_bytes() == build("Decay").read_bytes()


def test_the_bundled_description_is_the_one_of_the_sources(build: Build) -> None:
    rebuilt = build("ArchComp.AT", ROOT / "modelica" / "ArchComp")
    for name in ("modelDescription.xml", "sources/model.c"):
        assert zipfile.ZipFile(AT).read(name) == zipfile.ZipFile(rebuilt).read(name)


FOLDER = Path(__file__).parent / "refused"
CASES = sorted(path.stem for path in FOLDER.glob("*.mo"))

PROGRAM = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from export.cli import translate
from export.read.syntax import ExportError
found = {}
for path in sorted(Path(sys.argv[2]).glob("*.mo")):
    try:
        translate(path, "M")
        found[path.stem] = "translated"
    except ExportError as error:
        found[path.stem] = str(error)
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def messages() -> dict[str, str]:
    """The exporter's message for every model, from one process."""
    command = [exporter_python(), "-c", PROGRAM, str(ROOT / "modelica"), str(FOLDER)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG)
    assert done.returncode == 0, done.stderr
    found: dict[str, str] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("name", CASES)
def test_refused_with_file_and_line(messages: dict[str, str], name: str) -> None:
    lines = (FOLDER / f"{name}.mo").read_text().splitlines()
    [(number, part)] = [
        (k, line.split("// error: ")[1]) for k, line in enumerate(lines, 1) if "// error: " in line
    ]
    assert messages[name].startswith(f"{name}.mo:{number}: ")
    assert part in messages[name]


@pytest.mark.parametrize(
    "text", ["model A A a; end A;", "model A extends B; end A; model B extends A; end B;"]
)
def test_a_class_of_itself_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "M.mo").write_text(f"model M {text} A a; end M;")
    done = run_exporter("M", "--source", str(tmp_path / "M.mo"), "--output", str(tmp_path / "M.fmu"))
    assert (done.returncode, "contains or extends itself" in done.stderr) == (1, True)


def test_an_unknown_entry_of_the_table_is_named(tmp_path: Path) -> None:
    done = run_exporter("--all", str(tmp_path), "--only", "ATT")
    assert done.returncode == 1
    assert "no entry ATT" in done.stderr


@pytest.mark.parametrize("fmi", [2, 3])
def test_display_units_say_how_to_convert(build: Build, fmi: int) -> None:
    text = zipfile.ZipFile(build("Corners", fmi=fmi)).read("modelDescription.xml").decode()
    assert '<DisplayUnit name="degC" factor="1.0" offset="-273.15"' in text


def test_a_missing_file_and_a_missing_model_are_named(tmp_path: Path) -> None:
    done = run_exporter("M", "--source", str(tmp_path / "none.mo"))
    assert done.returncode == 1
    assert "none.mo does not exist" in done.stderr
    done = run_exporter("Nothing")
    assert done.returncode == 1
    assert "there is no model 'Nothing'" in done.stderr
