import csv
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

from falsifier.campaigns.analysis import load
from falsifier.cli.report import _evaluations_csv
from falsifier.core.function_model import FunctionModel
from falsifier.core.model import Variable
from falsifier.record.run import falsify
from falsifier.testing import BIAS, lag_problem
from tests.cli.support import NEVER, bench
from tests.command import falsifier


def test_reports_of_a_campaign_and_of_one_run(command: Any, tmp_path: Path) -> None:
    bench(command, "--out", "c", "--quiet")
    command("report", "c", "--arch-comp", "v.csv", code=0)
    assert (tmp_path / "c" / "report.html").read_text().startswith("<!DOCTYPE html>")
    assert (tmp_path / "v.csv").read_text().count("yes") == 2
    again = command("report", "c", "--arch-comp", "v.csv", "--markdown")
    assert again.stdout.startswith("# Falsification report: c")
    for _ in range(2):  # what it wrote is replaced
        command("report", str(next((tmp_path / "c" / "runs").glob("hard-*"))), "-o", "one.html", code=0)
    assert "1 of 1 requirement violated, 1 run," in (tmp_path / "one.html").read_text()


def test_files_of_the_competition_have_one_method_and_what_is_left_out_is_told(
    command: Any, campaign: Path, tmp_path: Path
) -> None:
    shutil.copytree(campaign, tmp_path / "c")
    journal = next((tmp_path / "c" / "runs").glob("impossible-corners-*")) / "journal.jsonl"
    journal.write_text("".join(journal.read_text().splitlines(keepends=True)[:-1]))
    for _ in range(2):  # what it wrote is replaced
        written = command("report", "c", "--arch-comp", "v.csv", "--markdown")
        assert "v.csv: 1 run not finished and left out" in written.output
    rows = {path.name: len(path.read_text().splitlines()) - 1 for path in tmp_path.glob("*.csv")}
    assert rows == {"v-uniform.csv": 4, "v-corners.csv": 3}
    (tmp_path / "v-uniform.csv").write_text("mine")
    assert "v-uniform.csv exists and is kept" in str(command("report", "c", "--arch-comp", "v.csv").exception)


def test_every_evaluation_is_written_as_a_table(command: Any, campaign: Path, tmp_path: Path) -> None:
    shutil.copytree(campaign, tmp_path / "c")
    for _ in range(2):  # what it wrote is replaced
        command("report", "c", "--csv", "e.csv", "--markdown", code=0)
    (tmp_path / "loop").symlink_to("loop")  # to itself: followed nowhere, and replaced
    command("report", "c", "--csv", "loop", "--markdown", code=0)
    with (tmp_path / "e.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["status"] for row in rows} == {"ok"}
    for run in load(tmp_path / "c"):
        name = (run.requirement, run.method.label, str(run.seed))
        own = [r for r in rows if (r["requirement"], r["method"], r["seed"]) == name]
        assert [float(r["robustness"]) for r in own] == run.robustness.tolist()
        assert all(r["critical_time"] for r in own)


def test_what_is_varied_has_a_column_beside_what_identifies_its_run(tmp_path: Path) -> None:
    plain = lag_problem(inputs=0, parameters=[BIAS])
    seed = Variable("seed", causality="parameter", start=0.0, settable=True)
    info = replace(plain.info, variables=(*plain.info.variables, seed))
    model = FunctionModel(lambda times, *_: {"x": 0 * times}, info)
    space = replace(plain.space, parameters=(replace(BIAS, name="seed"),))
    problem = replace(plain, model=model, space=space)
    result = falsify(problem, "uniform", budget=2, seed=7, directory=tmp_path)
    rows = list(csv.DictReader(_evaluations_csv([tmp_path]).splitlines()))
    assert [row["seed"] for row in rows] == ["7", "7"]
    assert [float(row["seed (varied)"]) for row in rows] == result.columns()["seed"]


def test_directories_are_compared_in_one_page(command: Any, campaign: Path, tmp_path: Path) -> None:
    runs = sorted(map(str, (campaign / "runs").iterdir()))
    assert command("report", *runs[:2], "-o", "both.html").exit_code == 0
    assert "What differs" in (tmp_path / "both.html").read_text()
    assert "takes one DIRECTORY" in command("report", *runs[:2], "--arch-comp", "v.csv", code=2).output


def test_validate_ends_with_1_where_a_claim_does_not_hold(command: Any, tmp_path: Path) -> None:
    (tmp_path / "v.csv").write_text(
        "system,property,instance,input,parameters,falsified,simulations,stop time\n"
        'AT,AT2,2,"[0 100 0; 5 100 0; 25 100 0]",[],1,2,30\n'
        'AT,AT2,2,"[0 0 0]",[],1,2,\n'
    )
    result = command("tools", "validate", "v.csv", code=1)
    assert "row 1, AT2: reproduced, robustness -" in result.stdout
    assert "row 2, AT2: not reproduced, robustness +" in result.stdout
    assert "1 of 2 counterexamples accepted" in result.stdout
    (tmp_path / "v.csv").write_bytes(b"\x9c\x00")
    unread = command("tools", "validate", "v.csv")
    assert "v.csv: cannot be read: expected a CSV file in UTF-8" in str(unread.exception)
    assert "v.csv: expected a file ending in .toml, .fmu" in str(command("simulate", "v.csv").exception)


def test_what_a_run_tried_is_printed_and_drawn(tmp_path: Path) -> None:
    falsifier("run", NEVER, "--engine", "corners", "--budget", "4", "--out", "r", cwd=tmp_path)
    done = falsifier("coverage", "r", cwd=tmp_path, code=0)
    for part in ("NEVER: what 4 simulations tried", "u [V]", "never tried", "x [m]", "r/coverage.png"):
        assert part in done.out, done.out
    assert (tmp_path / "r" / "coverage.png").read_bytes().startswith(b"\x89PNG")
    told = falsifier("coverage", "r", "--json", "--out", "c.png", cwd=tmp_path).json
    assert told["requirements"] == ["NEVER"]
    assert told["simulations"] == 4
    assert told["files"] == ["c.png"] and (tmp_path / "c.png").exists()
