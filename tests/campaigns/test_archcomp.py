import csv
from pathlib import Path

import numpy as np
import pytest

from falsifier.campaigns.archcomp import export, read_rows, tolerance, validate
from falsifier.campaigns.runs import load
from falsifier.errors import SpecError
from falsifier.problem.problem import Problem
from tests import problems

HEADER = "system,property,instance,input,parameters,falsified,simulations,"
HEADER += "simulation time,total time,robustness,stop time"


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small problems in place of the bundled ones, by the names of their requirements."""

    def found(requirement: str, instance: str, stop_time: float | None) -> Problem:
        return {"HARD": problems.hard, "CC1": problems.easy, "AT51": problems.easy}[requirement]()

    monkeypatch.setattr("falsifier.campaigns.archcomp.bundled_problem", found)


def rows(tmp_path: Path, *lines: str) -> Path:
    path = tmp_path / "claims.csv"
    path.write_text("\n".join([HEADER, *lines]) + "\n", encoding="utf-8")
    return path


@pytest.mark.usefixtures("small")
def test_what_is_exported_holds_when_it_is_simulated_again(campaign: Path, tmp_path: Path) -> None:
    path = tmp_path / "claims.csv"
    exported = export(load(campaign))
    assert list(exported) == ["uniform", "corners"], "the format does not tell methods apart"
    path.write_text("".join(exported.values()).replace(f"\n{HEADER}", ""), encoding="utf-8")
    with path.open(newline="") as file:
        cells = list(csv.DictReader(file))
    assert [c["falsified"] for c in cells] == ["yes", "yes", "no", "no"] * 2
    assert {c["input"] for c in cells if c["falsified"] == "no"} == {"[]"}
    findings = validate(read_rows(path))
    assert [f.accepted for f in findings] == [True] * 4
    for finding in findings:
        assert finding.robustness == pytest.approx(finding.row.robustness, abs=1e-6)
        assert np.diff(finding.row.input[:, 0]) == pytest.approx(0.05)


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize(
    ("line", "holds", "reason"),
    [
        ('S,HARD,1,"[0 1]",[],yes,3,1,1,-0.4,10', True, "reproduced"),
        ('S,HARD,1,"[0 1; 5 1; 10 1]",[],true,3,1,1,-0.4,', True, "reproduced"),
        ('S,HARD,1,"[0 -1; 10 -1]",[],yes,3,1,1,-0.4,10', False, "not reproduced"),
        ('S,HARD,1,"[0 1]",[],yes,1501,1,1,-0.4,10', False, "1501 simulations, more than the limit of 1500"),
        ('S,HARD,1,"[0 1.5]",[],yes,3,1,1,-0.4,10', False, "1.5 is outside its range [-1, 1]"),
        ('S,HARD,1,"[0 1 1]",[],yes,3,1,1,-0.4,10', False, "2 inputs and 0 parameters, expected 1 and 0"),
        ('S,HARD,1,"[0 1; 0 1]",[],yes,3,1,1,-0.4,10', False, "must increase strictly from 0"),
        # easy() with half the input has robustness 0.4: within CC's tolerance of 1, but AT5x has none.
        ('S,CC1,1,"[0 0.5]",[],yes,3,1,1,-0.4,10', True, "within the tolerance of 1"),
        ('S,AT51,1,"[0 0.5]",[],yes,3,1,1,-0.4,10', False, "not reproduced"),
    ],
)
def test_claims_are_judged_by_the_rules(tmp_path: Path, line: str, holds: bool, reason: str) -> None:
    (finding,) = validate(read_rows(rows(tmp_path, line)))
    assert finding.accepted == holds and reason in finding.reason


@pytest.mark.parametrize(("claimed", "read"), [("-0.4", -0.4), ("", None), ("NaN", None), ("-inf", None)])
def test_a_claimed_robustness_that_is_no_number_is_none(
    tmp_path: Path, claimed: str, read: float | None
) -> None:
    (row,) = read_rows(rows(tmp_path, f'S,HARD,1,"[0 1]",[],yes,3,1,1,{claimed},10'))
    assert row.robustness == read  # JSON has no word for others


@pytest.mark.usefixtures("small")
def test_coarse_inputs_are_piecewise_constant_and_dense_ones_are_as_given(tmp_path: Path) -> None:
    coarse, dense = '"[0 1; 1 -1]"', '"[0 1; 0.5 1; 0.9 -1]"'
    first, second = validate(
        read_rows(rows(tmp_path, *(f"S,HARD,1,{m},[],yes,3,1,1,-0.4,10" for m in (coarse, dense))))
    )
    # One second of full input, then the opposite: x(1) = 1 - 0.9**10; the dense one falls from 0.5 s on.
    assert first.robustness == pytest.approx(0.6 - (1 - 0.9**10))
    assert second.robustness is not None
    assert first.robustness != second.robustness and 0.6 > second.robustness > 0


def test_unknown_requirements_are_findings_without_the_list_of_all(tmp_path: Path) -> None:
    (finding,) = validate(read_rows(rows(tmp_path, 'SB,SB1,2,"[0 1]",[],yes,3,1,1,-0.4,10')))
    assert not finding.accepted
    assert "no bundled requirement 'SB1'" in finding.reason and "AT1" not in finding.reason


def test_unreadable_cells_name_their_row(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"row 1: column input: expected numbers .*'\[0 x\]'"):
        read_rows(rows(tmp_path, 'S,HARD,1,"[0 x]",[],yes,3,1,1,-0.4,10'))
    with pytest.raises(SpecError, match="row 1: column instance: expected '1' or '2', got '3'"):
        read_rows(rows(tmp_path, 'S,HARD,3,"[0 1]",[],yes,3,1,1,-0.4,10'))
    for number in ("many", "inf", "nan", "-1", ""):
        with pytest.raises(SpecError, match="row 1: column simulations: "):
            read_rows(rows(tmp_path, f'S,HARD,1,"[0 1]",[],yes,{number},1,1,-0.4,10'))


def test_rows_without_a_counterexample_need_no_input(tmp_path: Path) -> None:
    (row,) = read_rows(rows(tmp_path, "S,HARD,1,,,no,1500,1,1,,10"))
    assert (row.input.size, row.falsified, row.simulations) == (0, False, 1500)


def test_another_table_is_told_from_a_validation_file(tmp_path: Path) -> None:
    (tmp_path / "all.csv").write_text("requirement,method,robustness\nHARD,corners,1.0\n")
    with pytest.raises(
        SpecError, match=r"all\.csv: expected .* ARCH-COMP .* missing columns: property, input"
    ):
        read_rows(tmp_path / "all.csv")


def test_names_of_the_competition_are_understood(tmp_path: Path) -> None:
    theirs = ('"(NN 0.005 0.04)"', "F16a", "SCa", "AT1", '"(AFC27 0.008)"')
    lines = [f'S,{name},1,"[0 1]",[],yes,3,1,1,-0.4,10' for name in theirs]
    ours = ["NNb", "F16", "SC", "AT1", "AFC27"]
    assert [row.requirement for row in read_rows(rows(tmp_path, *lines))] == ours


@pytest.mark.parametrize(
    ("requirement", "expected"),
    [("AT1", 1.2), ("AT2", 10.0), ("AT6abc", 1.0), ("NNx", 0.1), ("CCx", 1.0), ("SC", 0.05)]
    + [("AFC27", 8e-4), ("AFC29", 7e-4), ("AFC33", 7e-4)]
    + [(name, 0.0) for name in ("AT51", "AT54", "F16", "mine")],
)
def test_tolerances(requirement: str, expected: float) -> None:
    assert tolerance(requirement) == expected
