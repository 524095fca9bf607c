import tomllib
from pathlib import Path

import pytest

from falsifier.fmu import read_info
from falsifier.problem.loading import load_problem
from falsifier.problem.starter import starter_spec
from tests.fmu.fixtures import path as fmu_path


def written(name: str, folder: Path) -> Path:
    spec = folder / "my.toml"
    spec.write_text(starter_spec(fmu_path(name), read_info(fmu_path(name))), encoding="utf-8")
    return spec


def test_names_and_texts_with_any_characters_give_valid_toml(tmp_path: Path) -> None:
    spec = written("OddNames_2", tmp_path)
    data = tomllib.loads(spec.read_text(encoding="utf-8"))
    assert list(data["inputs"]) == ['Öffnung "Ventil" 1']
    problem = load_problem(str(spec))
    assert problem.space.names == ('Öffnung "Ventil" 1',)
    assert problem.requirement.formula.signals == ("größe.y",)
    # Parameters are offered in comments; what these say is valid, too.
    offered = [line.removeprefix("# ") for line in spec.read_text("utf-8").splitlines() if "LOW" in line]
    keys = [next(iter(tomllib.loads(line.replace("[LOW, HIGH]", "[1, 2]")))) for line in offered]
    assert keys == ["'T of # plant'", "Verstärkung"]


def test_without_outputs_states_are_offered(tmp_path: Path) -> None:
    spec = written("NoOutputs_2dymola", tmp_path)
    assert "# The FMU declares no outputs. Requirements may name any variable: x\n" in spec.read_text("utf-8")
    assert load_problem(str(spec)).requirement.formula.signals == ("x",)


def test_unbounded_inputs_are_said_to_be_so(tmp_path: Path) -> None:
    text = written("HugeLimits_2", tmp_path).read_text("utf-8")
    assert "range = [0.0, 1.0]  # unbounded: the FMU specifies no min and max" in text


@pytest.mark.parametrize("name", ["Lag_1cs", "Lag_2", "Lag_3", "Arrays_3", "Aliases_3", "ClocksAndBinary_3"])
def test_every_starter_can_be_loaded(tmp_path: Path, name: str) -> None:
    if not fmu_path(name).is_file():
        pytest.skip("no such fixture")
    assert load_problem(str(written(name, tmp_path))).name == "R1"
