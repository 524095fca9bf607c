import shutil
from pathlib import Path

import pytest

from falsifier.errors import SpecError
from falsifier.fmu import read_info
from falsifier.problem.loading import load_problem
from falsifier.problem.spec import read_spec
from falsifier.problem.starter import starter_spec
from falsifier.problem.subject import subject_of, with_requirement
from tests.problem.support import AT, GOOD, spec


def test_a_requirement_is_added_to_a_spec_and_its_comments_are_kept(folder: Path) -> None:
    path = Path(spec(folder, f"# mine\n{GOOD}"))
    text, name = with_requirement(subject_of(str(path)), path, "G[0,9] (rpm <= 1)", description="Slow.")
    path.write_text(text)
    assert name == "R1"
    assert text.startswith("# mine\n")
    assert load_problem(f"{path}:R1").requirement.description == "Slow."
    assert str(load_problem(f"{path}:R").requirement.formula) == "G[0,20] (speed <= 120)"
    with pytest.raises(SpecError, match="has a requirement 'R' already"):
        with_requirement(subject_of(str(path)), path, "G (rpm <= 1)", name="R")


def test_sections_in_any_order_are_kept(folder: Path) -> None:
    more = "[profiles.fast]\ninputs.throttle.control_points = 9\n[requirements.S]\nformula = 'G (rpm <= 9)'\n"
    path = Path(spec(folder, GOOD + more))
    path.write_text(with_requirement(subject_of(f"{path}:S"), path, "G (rpm <= 1)")[0])
    assert set(read_spec(path).requirements) == {"R", "S", "R1"}
    assert set(read_spec(path).profiles) == {"fast"}


def test_in_another_folder_the_fmu_is_found(folder: Path) -> None:
    path = Path(spec(folder, GOOD))
    (folder / "deeper").mkdir()
    out = folder / "deeper" / "new.toml"
    out.write_text(with_requirement(subject_of(str(path)), out, "G (rpm <= 1)", name="N")[0])
    assert load_problem(f"{out}:N").name == "N"


def test_an_fmu_gets_a_starter_spec_with_this_requirement_only(tmp_path: Path) -> None:
    fmu = Path(shutil.copy(AT, tmp_path / "car.fmu"))
    subject = subject_of(str(fmu))
    assert subject.spec == tmp_path / "car.toml"
    text, name = with_requirement(subject, tmp_path / "car.toml", "G[0,9] (speed <= 'x')".replace("'x'", "3"))
    (tmp_path / "car.toml").write_text(text)
    assert name == "R1"
    assert str(load_problem(str(tmp_path / "car.toml")).requirement.formula) == "G[0,9] (speed <= 3)"
    assert subject_of(str(fmu)).is_new, "whether its spec is in the way depends on where is written"


def test_a_starter_spec_on_disk_gets_the_requirement_in_place_of_its_placeholder(tmp_path: Path) -> None:
    fmu = Path(shutil.copy(AT, tmp_path / "car.fmu"))
    path = tmp_path / "car.toml"
    path.write_text(starter_spec(Path(fmu.name), read_info(fmu)))
    subject = subject_of(str(path))
    assert not subject.is_new
    text, name = with_requirement(subject, path, "G[0,9] (speed <= 3)")
    path.write_text(text)
    assert (name, list(read_spec(path).requirements)) == ("R1", ["R1"])
    assert str(load_problem(str(path)).requirement.formula) == "G[0,9] (speed <= 3)"


def test_the_grid_follows_the_formula_unless_it_is_stated(folder: Path) -> None:
    subject = subject_of(spec(folder, GOOD))
    _, problem = subject.parsed("G[0,0.125] (speed <= 1)")
    assert 0.125 / problem.experiment.output_interval == pytest.approx(
        round(0.125 / problem.experiment.output_interval)
    )
    fixed = subject_of(
        spec(folder, GOOD.replace("[inputs.throttle]", "output_interval = 0.1\n[inputs.throttle]"))
    )
    with pytest.raises(SpecError, match="not a multiple"):
        fixed.parsed("G[0,0.125] (speed <= 1)")
    with pytest.raises(SpecError, match="position"):
        subject.parsed("G[0,1] (speed <=")


def test_bundled_specs_stay_as_they_are() -> None:
    assert subject_of("AT1").spec is None


def test_what_is_no_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="no such file"):
        subject_of(str(tmp_path / "no.fmu"))
