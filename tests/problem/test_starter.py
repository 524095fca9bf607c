from pathlib import Path

from falsifier.fmu import read_info
from falsifier.problem.loading import load_problem
from falsifier.problem.starter import starter_spec
from tests.fmu.fixtures import path as fmu_path
from tests.problem.support import spec


def test_the_starter_spec_loads_as_it_is(folder: Path) -> None:
    text = starter_spec(Path("AT.fmu"), read_info(folder / "AT.fmu"))
    problem = load_problem(spec(folder, text))
    assert problem.name == "R1"
    assert {r.name for r in problem.space.inputs} == {"throttle", "brake"}


def test_the_starter_spec_gives_whole_numbers_their_real_ranges(tmp_path: Path) -> None:
    text = starter_spec(fmu_path("Echo_3"), read_info(fmu_path("Echo_3")))
    path = tmp_path / "echo.toml"
    path.write_text(text)
    ranges = {r.name: (r.low, r.high, r.kind) for r in load_problem(str(path)).space.inputs}
    assert ranges["in_Enumeration"] == (1, 3, "enumeration")
    assert ranges["in_Boolean"] == (0, 1, "boolean")
    assert ranges["in_Int8"] == (0, 1, "integer")
    assert "# 1 = first, 2 = second, 3 = third\n[inputs.in_Enumeration]\nrange = [1, 3]\n" in text
    assert "[inputs.in_Boolean]\nrange = [0, 1]\n" in text
    assert "[inputs.in_Int8]\nrange = [0, 1]  # the FMU gives no min and max: put" in text
