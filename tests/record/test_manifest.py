from pathlib import Path

import pytest

from falsifier.errors import JournalError, SpecError
from falsifier.problem.loading import load_problem
from falsifier.problem.source import ProblemSource
from falsifier.record import manifest
from falsifier.record.manifest import Manifest, describe
from falsifier.search.request import RunRequest
from falsifier.testing import FREE, START, lag_problem
from tests.record.support import write_manifest

SOURCES = tuple(ProblemSource(target=f"AT:{name}") for name in ("AT1", "AT2"))
PROBLEMS = [load_problem("AT1"), load_problem("AT2")]
DESCRIBED = describe(RunRequest(problems=SOURCES), PROBLEMS, "corners")


def test_it_says_what_was_asked_for_and_with_what(tmp_path: Path) -> None:
    assert (DESCRIBED.names, DESCRIBED.shared, DESCRIBED.requirement.name) == (("AT1", "AT2"), True, "AT1")
    assert DESCRIBED.requirement.formula == "G[0,20] (speed <= 120)"
    assert [(i.name, i.low, i.high, i.unit) for i in DESCRIBED.inputs] == [
        ("throttle", 0, 100, "%"),
        ("brake", 0, 325, "ft.lbf"),
    ]
    assert (DESCRIBED.model, DESCRIBED.parameterization, DESCRIBED.stop_time) == ("ArchComp.AT", "free", 50.0)
    assert {Path(p).name for p in DESCRIBED.hashes} == {"AT.fmu", "AT.toml"}
    assert DESCRIBED.origin.fmu_sha256 == PROBLEMS[0].model.sha256  # type: ignore[attr-defined]
    assert {"numpy", "rtamt"} <= DESCRIBED.packages.keys()
    manifest.write(tmp_path, DESCRIBED)
    assert manifest.read(tmp_path).model_copy(update={"sum": ""}) == DESCRIBED


def test_a_problem_made_in_python_has_no_files() -> None:
    described = describe(RunRequest(problems=()), [lag_problem(free=FREE, parameters=[START])], "mine")
    assert (described.hashes, described.origin.fmu_sha256, described.shared) == ({}, None, False)
    assert [p.name for p in described.parameters] == ["x0"]
    assert [(h.name, h.value) for h in described.not_searched] == [("gain", 1.0), ("bias", 0.0)]
    assert describe(RunRequest(problems=()), [lag_problem()], "mine").parameterization == "fixed"


def test_one_requirement_of_several_is_a_manifest_of_its_own() -> None:
    alone = DESCRIBED.of("AT2")
    assert (alone.names, alone.shared) == (("AT2",), False)
    assert alone.request.source == SOURCES[1]
    assert Manifest.model_validate(alone.model_dump()) == alone
    with pytest.raises(JournalError, match="AT1, AT2"):
        DESCRIBED.of("AT3")


def test_a_key_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    write_manifest(tmp_path, DESCRIBED.model_dump(mode="json") | {"stop_time": "late"})
    with pytest.raises(JournalError, match="stop_time"):
        manifest.read(tmp_path)
    content = DESCRIBED.model_dump(mode="json")
    content["request"]["budget"]["simulations"] = -4
    write_manifest(tmp_path, content)
    with pytest.raises(
        SpecError, match=rf"{manifest.MANIFEST}: budget: simulations: expected a whole number, at least 1"
    ):
        manifest.read(tmp_path)
