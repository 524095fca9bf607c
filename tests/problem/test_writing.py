import shutil
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from falsifier.core.model import ModelInfo, Variable
from falsifier.errors import SpecError
from falsifier.fmu import read_info
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.problem.spec import read_spec
from falsifier.problem.writing import starter_spec, subject_of, with_requirement
from tests.fmu.fixtures import path as fmu_path
from tests.problem.support import AT, GOOD, spec


def loaded(path: Path) -> Problem:
    """The problem of a starter spec whose placeholder is replaced."""
    text = path.read_text("utf-8")
    assert text.count("<= LIMIT)'") == 1
    path.write_text(text.replace("LIMIT", "1"), "utf-8")
    return load_problem(str(path))


def test_the_starter_spec_loads_once_its_placeholder_is_replaced(folder: Path) -> None:
    text = starter_spec(Path("AT.fmu"), read_info(folder / "AT.fmu"))
    with pytest.raises(SpecError, match="LIMIT is a placeholder"):
        load_problem(spec(folder, text))
    problem = loaded(Path(spec(folder, text)))
    assert problem.name == "R1"
    assert {r.name for r in problem.space.inputs} == {"throttle", "brake"}


def test_the_starter_spec_gives_whole_numbers_their_real_ranges(tmp_path: Path) -> None:
    text = starter_spec(fmu_path("Echo_3"), read_info(fmu_path("Echo_3")))
    path = tmp_path / "echo.toml"
    path.write_text(text)
    ranges = {r.name: (r.low, r.high, r.kind) for r in loaded(path).space.inputs}
    assert ranges["in_Enumeration"] == (1, 3, "enumeration")
    assert ranges["in_Boolean"] == (0, 1, "boolean")
    assert ranges["in_Int8"] == (0, 1, "integer")
    assert "[inputs.in_Enumeration]\n# 1 = first, 2 = second, 3 = third\nrange = [1, 3]\n" in text
    assert "[inputs.in_Boolean]\nrange = [0, 1]\n" in text
    assert "[inputs.in_Int8]\nrange = [0, 1]  # unbounded: the FMU specifies no min and max; replace" in text


def test_what_the_fmu_does_not_say_is_marked_and_still_loads(tmp_path: Path) -> None:
    info = read_info(fmu_path("Ball_2"))
    for stop_time in (1 / 30, 12.34567890123456):
        text = starter_spec(fmu_path("Ball_2"), replace(info, stop_time=stop_time))
        (tmp_path / "ball.toml").write_text(text)
        assert loaded(tmp_path / "ball.toml").requirement.formula.horizon() == stop_time
    bare = replace(info, stop_time=None, step_size=None, description="")
    text = starter_spec(fmu_path("Ball_2"), bare)
    assert "# the FMU specifies none" in text
    (tmp_path / "ball.toml").write_text(text)
    problem = loaded(tmp_path / "ball.toml")
    assert problem.space.inputs == ()
    (searched,) = problem.space.parameters  # without inputs one is searched
    assert text.count(f"\n{searched.name}.range") == 1
    assert f"# {searched.name}.range" not in text


def written(name: str, folder: Path) -> Path:
    spec = folder / "my.toml"
    spec.write_text(starter_spec(fmu_path(name), read_info(fmu_path(name))), encoding="utf-8")
    return spec


def test_names_and_texts_with_any_characters_give_valid_toml(tmp_path: Path) -> None:
    spec = written("OddNames_2", tmp_path)
    data = tomllib.loads(spec.read_text(encoding="utf-8"))
    assert list(data["inputs"]) == ['Öffnung "Ventil" 1']
    problem = loaded(spec)
    assert problem.space.names == ('Öffnung "Ventil" 1',)
    assert problem.requirement.formula.signals == ("größe.y",)
    # Parameters are offered in comments; what these say is valid, too.
    offered = [line.removeprefix("# ") for line in spec.read_text("utf-8").splitlines() if "LOW" in line]
    keys = [next(iter(tomllib.loads(line.replace("[LOW, HIGH]", "[1, 2]")))) for line in offered]
    assert keys == ["'T of # plant'", "Verstärkung", "plant\\x"], "parameters, and then initial states"


@pytest.mark.parametrize(
    ("stated", "ends"),
    [
        ({"start": -5.0, "low": 0.0}, [0.0, 2.5]),
        ({"start": 5.0, "high": 1.0}, [-1.5, 1.0]),
        ({"start": 0.0, "kind": "integer", "type": "UInt8"}, [0, 1]),
    ],
)
def test_a_parameter_to_search_has_a_range_whatever_its_start(
    stated: dict[str, Any], ends: list[float]
) -> None:
    kept = Variable("kept", "enumeration", "parameter", start=1.0, settable=True, literals={"only": 1})
    known = Variable("u", causality="input", low=1.0, high=1.0), Variable("y", causality="output")
    searched = Variable("p", causality="parameter", settable=True, **stated)
    text = starter_spec(Path("m.fmu"), ModelInfo("m", variables=(kept, searched, *known)))
    assert tomllib.loads(text)["parameters"] == {"p": {"range": ends}}
    with pytest.raises(SpecError, match="nothing to search"):
        starter_spec(Path("m.fmu"), ModelInfo("m", variables=(kept, *known)))


def test_parameters_beyond_the_first_ten_are_counted() -> None:
    items = {"off": 1, "on": 2}
    mode = Variable("mode", "enumeration", "parameter", start=2.0, settable=True, literals=items)
    many = tuple(replace(mode, name=f"p{k}", kind="integer", literals={}) for k in range(12))
    ends = Variable("u", causality="input"), Variable("y", causality="output")
    text = starter_spec(Path("m.fmu"), ModelInfo("m", variables=(mode, *many, *ends)))
    assert "# mode.range = [1, 2]  # default: 2 (1 = off, 2 = on)\n" in text
    assert "# p0.range = [LOW, HIGH]  # default: 2\n" in text
    assert "# ... and 3 more, which falsifier info lists\n" in text


def test_outputs_of_a_fitting_unit_are_offered_for_the_inputs_of_a_system() -> None:
    ends = (
        Variable("c.a.v", unit="km/h", causality="input"),
        Variable("c.a.odd", unit="furlong", causality="input"),
        Variable("c.out", unit="m/s", causality="output"),
        *(Variable(f"p.{name}", unit=unit, causality="output") for name, unit in (("x", "m"), ("w", "m/s"))),
    )
    text = starter_spec({"c": Path("c.fmu"), "p": Path("p.fmu")}, ModelInfo("m", variables=ends))
    assert '# "c.a.v" = "p.w"\n' in text, "neither what has another unit nor an output of its own"
    assert '# "c.a.odd" = "p.x" or "p.w"\n' in text


def test_without_outputs_states_are_offered(tmp_path: Path) -> None:
    spec = written("NoOutputs_2dymola", tmp_path)
    assert "# The FMU has no outputs. Requirements may name any variable: x\n" in spec.read_text("utf-8")
    assert loaded(spec).requirement.formula.signals == ("x",)


@pytest.mark.parametrize("name", ["Lag_1cs", "Lag_2", "Lag_3", "Arrays_3", "Aliases_3", "ClocksAndBinary_3"])
def test_every_starter_can_be_loaded(tmp_path: Path, name: str) -> None:
    assert loaded(written(name, tmp_path)).name == "R1"


def test_a_requirement_is_added_to_a_spec_and_its_comments_are_kept(folder: Path) -> None:
    path = Path(spec(folder, f"# mine\n{GOOD}"))
    text, name = with_requirement(subject_of(str(path)), path, "G[0,9] (rpm <= 1)", description="Slow.")
    path.write_text(text)
    assert name == "R1"
    assert text.startswith("# mine\n")
    assert load_problem(f"{path}:R1").requirement.description == "Slow."
    assert str(load_problem(f"{path}:R").requirement.formula) == "G[0,20] (speed <= 120)"


def test_sections_in_any_order_are_kept(folder: Path) -> None:
    more = "[profiles.fast]\ninputs.throttle.control_points = 9\n[requirements.S]\nformula = 'G (rpm <= 9)'\n"
    path = Path(spec(folder, GOOD + more))
    path.write_text(with_requirement(subject_of(f"{path}:S"), path, "G (rpm <= 1)", description="")[0])
    assert set(read_spec(path).requirements) == {"R", "S", "R1"}
    assert set(read_spec(path).profiles) == {"fast"}


def test_in_another_folder_the_fmu_is_found(folder: Path) -> None:
    path = Path(spec(folder, GOOD))
    (folder / "deeper").mkdir()
    out = folder / "deeper" / "new.toml"
    out.write_text(with_requirement(subject_of(str(path)), out, "G (rpm <= 1)", description="")[0])
    assert load_problem(f"{out}:R1").name == "R1"


def test_in_another_folder_all_files_are_found(tmp_path: Path) -> None:
    (tmp_path / "a" / "data").mkdir(parents=True)
    shutil.copy(fmu_path("Table_2"), tmp_path / "a" / "t.fmu")
    for name in ("table.txt", "control.c", "data/other.txt"):
        (tmp_path / "a" / name).write_text("1.5")
    path, out = tmp_path / "a" / "t.toml", tmp_path / "b" / "t.toml"
    path.write_text(f"""
        model = {{ fmu = "t.fmu", allow = ["programs", "read:data"] }}
        context = {{ files = ["control.c", "{tmp_path}/a/data"], checked = ["control.c", "t.fmu: x.c"] }}
        inputs.u.range = [0, 1]
        parameters.fileName = "table.txt"
        [requirements.R]
        formula = "G (y <= 9)"
        parameters.fileName.value = "data/other.txt"
        [profiles.p]
        allow = ["write:data"]
        requirements.R.parameters.fileName = "none.txt"
        """)
    out.parent.mkdir()
    out.write_text(with_requirement(subject_of(str(path)), out, "G (y <= 8)", description="table.txt")[0])
    found = tomllib.loads(out.read_text())
    assert found["model"] == {"fmu": "../a/t.fmu", "allow": ["programs", "read:../a/data"]}
    checked = ["../a/control.c", "t.fmu: x.c"]
    assert found["context"] == {"files": ["../a/control.c", f"{tmp_path}/a/data"], "checked": checked}
    assert found["parameters"] == {"fileName": "../a/table.txt"}
    assert found["requirements"]["R"]["parameters"]["fileName"]["value"] == "../a/data/other.txt"
    requirements = {"R": {"parameters": {"fileName": "none.txt"}}}
    assert found["profiles"]["p"] == {"allow": ["write:../a/data"], "requirements": requirements}
    ((_, text),) = load_problem(f"{out}:R1").experiment.strings
    assert Path(text).samefile(tmp_path / "a" / "table.txt")


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere all names are text")
def test_from_another_folder_one_that_is_not_of_utf_8_cannot_be_named(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inside = folder / "\udce9"
    inside.mkdir()
    (folder / "AT.fmu").rename(inside / "AT.fmu")
    monkeypatch.chdir(inside)
    subject = subject_of(spec(Path(), GOOD))
    with pytest.raises(SpecError, match=r"AT\.fmu: the name is not valid UTF-8"):
        with_requirement(subject, folder / "new.toml", "G (rpm <= 1)", description="")


def test_a_spec_keeps_its_line_ends(folder: Path) -> None:
    path = Path(spec(folder, GOOD))
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    text, _ = with_requirement(subject_of(str(path)), path, "G (rpm <= 1)", description="")
    assert text.count("\r\n") == text.count("\n") and "\r\r" not in text


def test_a_starter_spec_on_disk_gets_the_requirement_in_place_of_its_placeholder(tmp_path: Path) -> None:
    fmu = Path(shutil.copy(AT, tmp_path / "car.fmu"))
    path = tmp_path / "car.toml"
    path.write_text(starter_spec(Path(fmu.name), read_info(fmu)))
    subject = subject_of(str(path))
    assert not subject.is_new
    own: Any = SimpleNamespace(info=ModelInfo("m", variables=(Variable("LIMIT"),)))
    assert subject.is_started and not replace(subject, problem=own).is_started, "compared with a variable"
    text, name = with_requirement(subject, path, "G[0,9] (speed <= 3)", description="")
    path.write_text(text)
    assert (name, list(read_spec(path).requirements)) == ("R1", ["R1"])
    assert str(load_problem(str(path)).requirement.formula) == "G[0,9] (speed <= 3)"


def test_the_grid_follows_the_formula_unless_it_is_stated(folder: Path) -> None:
    subject = subject_of(spec(folder, GOOD))
    _, problem = subject.parsed("G[0,0.125] (speed <= 1)")
    intervals = 0.125 / problem.experiment.output_interval
    assert intervals == pytest.approx(round(intervals))
    stated = GOOD.replace("[inputs.throttle]", "output_interval = 0.1\n[inputs.throttle]")
    fixed = subject_of(spec(folder, stated))
    with pytest.raises(SpecError, match="not a multiple"):
        fixed.parsed("G[0,0.125] (speed <= 1)")
    with pytest.raises(SpecError, match="position"):
        subject.parsed("G[0,1] (speed <=")
    stepped = GOOD.replace("[inputs.throttle]", "step_size = 0.04\n[inputs.throttle]", 1)
    with pytest.raises(SpecError, match=r"0\.06 s of the window .* nearest multiple is 0\.08 s$"):
        subject_of(spec(folder, stepped)).parsed("G[0,0.06] (speed <= 1)")


def test_what_a_requirement_changes_does_not_hold_for_a_new_one(folder: Path) -> None:
    path = Path(spec(folder, GOOD.replace("[requirements.R]", "[requirements.R]\nstop_time = 99.0")))
    for target in (f"{path}", f"{path}:R"):
        with pytest.raises(SpecError, match="shorten the windows"):
            subject_of(target).parsed("G[0,80] (rpm <= 1)")
    with pytest.raises(SpecError, match="no requirement 'S'"):
        subject_of(f"{path}:S")


def test_an_inline_table_of_requirements_gets_one_more(folder: Path) -> None:
    text, _, _ = GOOD.partition("[requirements.R]")
    path = Path(spec(folder, f"requirements = {{ R = {{ formula = 'G (speed <= 1)' }} }}\n{text}"))
    path.write_text(with_requirement(subject_of(str(path)), path, "G (rpm <= 1)", description="")[0])
    assert set(read_spec(path).requirements) == {"R", "R1"}
