"""The plugin as its users see it: pytest in another process, in a small repository of FMU and spec."""

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from falsifier.core.files import bundled
from falsifier.counterexamples.regression import Database, check
from falsifier.counterexamples.store import to_store
from falsifier.testing import lag_problem
from pytest_falsifier import UnconfirmedWarning, UntestedError, UntestedWarning, _tell_doubts
from tests.command import ROOT, Done, forked
from tests.fmu.fixtures import path as fixture
from tests.pictures import CRITICAL, INPUT, OUTPUT, colours
from tests.problems import broken
from tests.stepped import euler_problem

SPEC = """
[model]
fmu = "../fmus/AT.fmu"
interface = "co-simulation"
stop_time = 30.0
output_interval = 0.05
[inputs.throttle]
control_points = 2
[inputs.brake]
control_points = 1
[requirements.fast]
formula = "G[0,20] (speed <= 120)"
[requirements.impossible]
formula = "G[0,20] (speed <= 500)"
"""


def run_pytest(folder: Path, *arguments: str) -> Done:
    # Where the package is installed pytest finds the plugin itself, and must not be given it twice.
    installed = any(point.value == "pytest_falsifier" for point in entry_points(group="pytest11"))
    plugin = [] if installed else ["-p", "pytest_falsifier"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "200"}
    return forked(["pytest", *plugin, *arguments], folder, environment)


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("repository")
    for name in ("fmus", "specs", "tests"):
        (folder / name).mkdir()
    shutil.copy(bundled("fmus") / "AT.fmu", folder / "fmus" / "AT.fmu")
    (folder / "specs" / "car.toml").write_text(SPEC)
    (folder / "specs" / "other.toml").write_text("[tool]\nname = 'not a spec'\n")
    (folder / "pytest.ini").write_text("[pytest]\nfalsifier_budget = 10\nfalsifier_engine = corners\n")
    return folder


def test_each_requirement_is_a_test_and_a_counterexample_is_shown_stored_and_replayed(
    repository: Path,
) -> None:
    shutil.rmtree(repository / "counterexamples", ignore_errors=True)  # of another test
    first = run_pytest(repository, "--falsifier", "specs", "-rA")
    assert first.code == 1, first.out + first.err
    assert "1 failed, 1 passed" in first.out
    for part in (
        "fast is violated by a counterexample found by a search",
        "throttle [%] constant 100",
        "brake [ft.lbf] constant 0",
        "  what broke     speed <= ",
        "With throttle at rest (0 %) alone: +",
        "replay with    falsifier replay counterexamples/specs/car.toml/fast/",
    ):
        assert part in first.out
    pictures = [line.split()[-1] for line in first.out.splitlines() if line.startswith("  picture ")]
    assert {OUTPUT, INPUT, CRITICAL} <= colours(repository / pictures[0])
    stored = list((repository / "counterexamples").rglob("*.json"))
    assert [p.parent for p in stored] == [repository / "counterexamples/specs/car.toml/fast"]
    assert json.loads(stored[0].read_text())["problem"]["target"] == "../../../../specs/car.toml:fast"
    second = run_pytest(repository, "--falsifier", "specs", "-k", "fast", "-p", "no:cacheprovider")
    assert f"picture        {stored[0].parent.relative_to(repository)}/specs-car.toml-fast" in second.out
    assert "fast is violated by a stored counterexample" in second.out
    assert run_pytest(repository, "--falsifier", "specs", "-m", "not falsifier", "--co").code == 5


def test_what_is_meant_as_a_spec_is_collected_or_told_and_other_files_are_left_alone(
    repository: Path, tmp_path: Path
) -> None:
    system = SPEC[SPEC.index("[inputs.throttle]") :].replace("[inputs", "[connections]\n[inputs", 1)
    files = {
        "system.toml": f'[components.car]\nfmu = "AT.fmu"\n{system}',
        "conflict.toml": f"{SPEC}<<<<<<< HEAD\n",
        "pionts.toml": SPEC.replace("control_points = 2", "control_pionts = 2"),
        "modle.toml": SPEC.replace("[model]", "[modle]"),
        "requirement.toml": SPEC.replace("[requirements.", "[requirement."),
        "broken.toml": "[model\nfmu=",
        "unfinished.toml": "[model]\nfmu = 'AT.fmu'\n[inputs.u]\n",
        "foreign.toml": "[tool]\nname = 'other'\nrequirements = ['numpy']\n",
        "Cargo.toml": "[tool.other]\n[requirements.R]\n",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    done = run_pytest(tmp_path, "--falsifier", "--co", "--continue-on-collection-errors")
    assert done.code == 1 and "4 errors" in done.out and "Traceback" not in done.out, done.out
    for part in (
        "<SpecFile system.toml>",
        "conflict.toml: not valid TOML: Invalid statement",
        "inputs.throttle.control_pionts: unknown key; did you mean 'control_points'",
        "modle.toml: modle: unknown key; did you mean 'model'",
        "requirement.toml: requirement: unknown key; did you mean 'requirements'",
        "broken.toml is not collected: it cannot be read as TOML (Expected ']'",
        "unfinished.toml is not collected: it has tables of a spec (model, inputs), but no [requirements",
    ):
        assert part in done.out
    assert "foreign.toml" not in done.out and "Cargo.toml" not in done.out
    for name in ("foreign.toml", "Cargo.toml", "broken.toml"):  # given by its name, each is a spec
        done = run_pytest(tmp_path, "--falsifier", name)
        assert done.code == 2 and f"ERROR collecting {name}" in done.out, done.out


def test_the_fixture_and_the_marker_in_ordinary_tests(repository: Path) -> None:
    shutil.copy(ROOT / "tests" / "fixtures" / "ordinary_tests.txt", repository / "tests" / "test_lag.py")
    done = run_pytest(repository, "tests")
    assert "1 failed, 9 passed" in done.out, done.out
    assert "LAG is violated by a counterexample found by a search" in done.out
    assert "replay with    pytest tests/test_lag.py::test_violated" in done.out
    assert "pytest_falsifier.py" not in done.out
    elsewhere = ("--falsifier-database", "my own", "-k", "test_violated")
    again = run_pytest(repository / "specs", f"{repository}/tests", *elsewhere)
    assert f"pytest --falsifier-database 'my own' {repository}/tests/test_lag.py::test_violated" in again.out


def test_importing_the_plugin_loads_nothing_else() -> None:
    code = (
        "import pytest, sys; before = set(sys.modules); import pytest_falsifier; "
        "print(*(set(sys.modules) - before))"
    )
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    printed = subprocess.check_output([sys.executable, "-c", code], env=env, text=True)
    assert printed.split() == ["pytest_falsifier"]


def test_specs_of_one_name_have_their_own_counterexamples_and_what_is_unused_is_told(
    repository: Path, tmp_path: Path
) -> None:
    shutil.copytree(repository / "fmus", tmp_path / "fmus")
    for folder, limit in (("a", 120), ("b", 119), ("c", 500)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "car.toml").write_text(SPEC.replace("<= 120", f"<= {limit}"))
    settings = ("-ofalsifier_engine=corners", "-ofalsifier_budget=10")
    options = ("--falsifier", *settings, "-k", "not impossible")
    first = run_pytest(tmp_path, *options)
    assert "2 failed, 1 passed" in first.out and "stored counterexample" not in first.out, first.out
    stored = sorted((tmp_path / "counterexamples").rglob("*.json"))
    assert [p.parent.relative_to(tmp_path / "counterexamples").as_posix() for p in stored] == [
        "a/car.toml/fast",
        "b/car.toml/fast",
    ]
    pictures = {line.split()[-1] for line in first.out.splitlines() if line.startswith("  picture ")}
    assert len(pictures) == 2

    spec = tmp_path / "a" / "car.toml"
    spec.write_text(spec.read_text().replace("fast", "slow").replace("120", "500"))
    (tmp_path / "b").rename(tmp_path / "d")
    done = run_pytest(tmp_path, *options, "a")
    assert "1 passed" in done.out, done.out
    for part in (
        f"car.toml/fast/{stored[0].name} is not replayed, because a/car.toml has no requirement 'fast'. If "
        "it was renamed or moved, move the file to counterexamples/a/car.toml/NEW-NAME; otherwise delete it",
        f"car.toml/fast/{stored[1].name} is not replayed, because b/car.toml does not exist.",
    ):
        assert part in done.out
    errors = ("-W", "error::pytest_falsifier.RequirementWarning", "--continue-on-collection-errors")
    done = run_pytest(tmp_path, *options, *errors, "a")
    assert "1 passed" in done.out and done.out.count("ERROR collecting counterexamples/") == 2, done.out

    stored[0].parent.rename(stored[0].parent.with_name("slow"))
    spec.write_text(spec.read_text().replace("500", "120"))
    done = run_pytest(tmp_path, *options, "a")
    assert "a/car.toml has no" not in done.out and "violated by a stored counterexample" in done.out, done.out
    assert "replay with    pytest --falsifier a/car.toml::slow" in done.out
    spec.write_text(spec.read_text().replace("[inputs.throttle]", "[inputs.throttle]\nrange = [0, 50]"))
    done = run_pytest(tmp_path, *options, "a")
    assert f"slow/{stored[0].name} tests nothing. slow: the counterexample does not fit" in done.out, done.out
    assert "100 is outside its range [0, 50]" in done.out and "or delete the file" in done.out


def test_a_counterexample_that_cannot_be_stored_or_drawn_is_shown(repository: Path) -> None:
    (repository / "file").write_text("no folder")
    options = ("--falsifier", "--falsifier-database", "file", "-o", "cache_dir=file", "-k", "fast")
    done = run_pytest(repository, "specs", *options)
    assert done.code == 1 and "throttle [%] constant 100" in done.out, done.out
    assert f"not stored     {repository / 'file'}/specs/car.toml/fast: Not a directory" in done.out
    assert "picture        cannot be written: " in done.out and "Traceback" not in done.out


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("-ofalsifier_budget=abc", "budget: expected a whole number from 1 to 10000000, got 'abc'"),
        ("-ofalsifier_budget=99999999999", "budget: .* from 1 to 10000000, got '99999999999'"),
        ("-ofalsifier_seed=-1", "seed: expected a whole number from 0 to .*, got '-1'"),
        ("-ofalsifier_strict=x", "strict: .*x"),
        ("-ofalsifier_engine=surogate", "engine: unknown engine 'surogate'; did you mean 'surrogate'"),
        ("-ofalsifier_engine=hybrid", "engine: hybrid asks a language model, and tests ask none"),
        ("--falsifier-budget=0", "budget: .*from 1 to 10000000, got 0"),
    ],
)
def test_a_wrong_setting_is_a_usage_error_that_names_it(repository: Path, option: str, said: str) -> None:
    done = run_pytest(repository, "--falsifier", "specs", option)
    assert done.code == 4 and "Traceback" not in done.err
    assert re.search(f"ERROR: falsifier_{said}", done.err), done.err


HOSTILE = """
[model]
fmu = "../fmus/Misdeeds_2.fmu"
stop_time = 1.0
output_interval = 0.1
[parameters.misdeed]
range = [1, 3]
[requirements."../../[31mred::line"]
formula = "y >= -1"
"""


def test_lists_of_packages_and_files_that_are_not_asked_for_are_no_errors(repository: Path) -> None:
    (repository / "specs" / "tool.toml").write_text("[requirements]\nnumpy = '>1'\n")
    alone = run_pytest(repository, "--falsifier", "specs/car.toml", "--co")
    assert alone.code == 0 and "tool.toml" not in alone.out, alone.out
    folder = run_pytest(repository, "--falsifier", "specs", "--co")
    assert folder.code == 0 and "tool.toml is not collected: it has tables of a spec" in folder.out
    assert "(requirements of values)" in folder.out


def test_hostile_specs_and_fmus_are_failures_of_one_line(tmp_path: Path) -> None:
    for name in ("fmus", "specs"):
        (tmp_path / name).mkdir()
    shutil.copy(fixture("Misdeeds_2"), tmp_path / "fmus")
    (tmp_path / "specs" / "hostile.toml").write_text(HOSTILE)
    (tmp_path / "specs" / "deep.toml").write_text(f"a = {'[' * 100_000}{']' * 100_000}")
    (tmp_path / "specs" / "long.toml").write_text(f"a = {'9' * 5000}")
    (tmp_path / "specs" / "bytes.toml").write_bytes(b"\xff\xfe[model]")
    (tmp_path / "specs" / "gone.toml").symlink_to("/nonexistent")
    done = run_pytest(
        tmp_path, "--falsifier", "--falsifier-budget", "1", "--falsifier-engine", "corners", "-q"
    )
    assert done.code == 1
    assert "1 failed" in done.out
    assert "\x1b" not in done.out and "Traceback" not in done.out
    assert "the FMU's process crashed" in done.out


def test_what_no_simulation_tested_is_a_warning_and_with_strict_an_error(
    request: pytest.FixtureRequest,
) -> None:
    checked = check(lag_problem("G[0,10] (x >= 2 -> u <= 0)"), engine="uniform", budget=2)
    with pytest.warns(UntestedWarning, match="The condition x >= 2 never held in 2 simulations"):
        _tell_doubts(request.node, checked, strict=False)
    with pytest.raises(UntestedError, match="LAG is not falsified, but not all of it was tested"):
        _tell_doubts(request.node, checked, strict=True)
    half = check(lag_problem("G[0,10] (x <= 2)", response=broken), engine="uniform", budget=7)
    with pytest.raises(UntestedError, match=r"not all of it was tested\n2 simulations failed, .*x' is nan"):
        _tell_doubts(request.node, half, strict=True)


def test_a_violation_that_is_not_confirmed_is_a_warning_and_with_strict_an_error(
    request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    problem, database = euler_problem("G[1,1] (x <= 0.65)"), Database(tmp_path)
    checked = check(problem, engine="corners", budget=2, database=database)
    assert checked.counterexample is None and checked.result is not None
    with pytest.warns(UnconfirmedWarning, match="no violation is confirmed\nfragile: .*does not violate"):
        _tell_doubts(request.node, checked, strict=False)
    lost = [replace(each, status="failed", reason="lost") for each in checked.result.evaluations]
    partly = replace(checked, result=replace(checked.result, evaluations=tuple(lost)))
    with pytest.raises(UntestedError, match="LAG was violated, but") as told:
        _tell_doubts(request.node, partly, strict=True)
    assert "LAG is not falsified, but" in str(told.value) and "not violated" not in str(told.value)
    file = database.save(problem, to_store(checked.result.fragile[0]))
    stored = check(problem, engine="uniform", budget=1, database=database)
    with pytest.raises(UntestedError, match=f"{file.name}: LAG: fragile"):
        _tell_doubts(request.node, stored, strict=True)
    doubted = replace(stored.replayed[file], status="does not violate")  # it did, but not again
    with pytest.raises(UntestedError, match=f"{file.name}: LAG: "):
        _tell_doubts(request.node, replace(stored, replayed={file: doubted}), strict=True)
