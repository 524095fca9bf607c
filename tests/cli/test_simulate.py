import json
from pathlib import Path

import pytest

from falsifier.core.files import bundled
from falsifier.record.run import falsify
from falsifier.testing import lag_problem
from tests.command import falsifier
from tests.fmu.fixtures import altered, path as fixture
from tests.fmu.packages import PLANT, structure, system, write
from tests.pictures import CRITICAL, INPUT, OUTPUT, colours
from tests.problems import easy

EASY = "python:tests.problems:easy"


def test_own_inputs_are_judged_and_written(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("time,u,x\n0,1,0\n8,1,0\n8,-1,0\n10,-1,0\n")
    done = falsifier("simulate", EASY, "--inputs", "u.csv", "--out", "o", "--json", cwd=tmp_path, code=1)
    assert done.json["violated"] and done.json["critical_time"] == pytest.approx(8)
    assert "not inputs of the model, and not used: x" in done.err
    assert {OUTPUT, INPUT, CRITICAL} <= colours(tmp_path / "o" / "trajectory.png")
    header, *rows = (tmp_path / "o" / "trajectory.csv").read_text().splitlines()
    assert header == "time,x,u" and len(rows) == 101
    again = falsifier("simulate", EASY, "--inputs", "o/input.csv", "--json", cwd=tmp_path)
    assert again.json["robustness"] == done.json["robustness"]


def test_constants_and_parameters_are_set_and_the_text_says_what_decided(tmp_path: Path) -> None:
    done = falsifier("simulate", EASY, "--set", "u=0.5", "--set", "x0=0.25", cwd=tmp_path, code=0)
    for part in ("EASY: not violated", "robustness     +0.4", "decided by x <= 0.9", "constant 0.5", "x0"):
        assert part in done.out
    assert list(tmp_path.iterdir()) == []


def test_a_string_gets_the_text_that_was_typed(tmp_path: Path) -> None:
    (tmp_path / "007").write_text("2.5")
    said = ["--stl", "G[0,1] (y <= 3)", "--set", "fileName=007", "--set", "u=1.0e0", "--json"]
    done = falsifier("simulate", str(fixture("Table_2")), *said, cwd=tmp_path)
    assert done.json["robustness"] == 0.5, done.err


def test_values_beyond_the_models_limits_are_simulated_and_drawn(tmp_path: Path) -> None:
    done = falsifier("simulate", "AT1", "--set", "throttle=100.000001", "--out", "out", cwd=tmp_path)
    assert "constant 100.000001" in done.out, done.err
    assert "throttle: 100.000001 exceeds the model's limits for 'throttle', [0, 100]" in done.err
    assert (tmp_path / "out" / "trajectory.png").is_file()


def test_notes_on_the_model_are_told_as_by_run(tmp_path: Path) -> None:
    done = falsifier("simulate", str(fixture("LateStart_2")), "--stl", "y <= 3", cwd=tmp_path)
    assert "the default experiment starts at 5 s; here simulations start at 0 s" in done.err


def test_a_value_that_may_be_in_the_displayed_unit_is_noted(tmp_path: Path) -> None:
    old, new = b'unit="m" start="1.0"', b'unit="K" displayUnit="degC" start="293.15"'
    ball = altered(fixture("Ball_2"), tmp_path / "ball.fmu", lambda text: text.replace(old, new))
    said = ["simulate", str(ball), "--stl", "G[0,1] (h <= 500)", "--set"]
    note = "h: 20 degC would be nearer to its start value, 293.15 K; all numbers are in K"
    assert note in falsifier(*said, "h=20", cwd=tmp_path).err
    assert "degC" not in falsifier(*said, "h=300", cwd=tmp_path).err


def test_how_long_a_file_lasts_is_told(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("time,throttle,brake\n0,50,-3\n49.999999,50,0\n")
    done = falsifier("simulate", "AT1", "--inputs", "u.csv", cwd=tmp_path)
    assert "u.csv: ends at 49.999999 s; the last values are kept until 50 s" in done.err
    assert "brake: [-3, 0] exceeds the model's limits" in done.err and "throttle:" not in done.err


def test_changes_between_two_communication_points_are_noted(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("time,throttle,brake\n0,0,0\n20.001,0,0\n20.002,100,0\n20.003,0,9\n")
    given = ("simulate", "AT1", "--inputs", "u.csv")
    done = falsifier(*given, cwd=tmp_path)
    assert "throttle: changes 0.001 s apart may not be seen, as inputs are set every 0.01 s" in done.err
    assert "brake" not in done.err, "it changes once"
    assert "apart" not in falsifier(*given, "--interface", "model-exchange", cwd=tmp_path).err
    (tmp_path / "u.csv").write_text("time,throttle,brake\n0,0,0\n20,0,0\n20.01,100,0\n20.02,0,0\n")
    assert "apart" not in falsifier(*given, cwd=tmp_path).err


def test_a_searched_input_that_is_not_given_is_told(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("time,throttle\n0,50\n")
    done = falsifier("simulate", "AT1", "--inputs", "u.csv", cwd=tmp_path)
    assert "no values given for brake: kept at the model's start value" in done.err
    ball = falsifier("simulate", str(fixture("Ball_2")), "--stl", "G[0,1] (h <= 5)", cwd=tmp_path)
    assert "stl: not violated (" in ball.out, "it has no inputs"
    fmu = bundled("fmus") / "AT.fmu"
    (tmp_path / "car.toml").write_text(f"""
        model = {{ fmu = '{fmu}', interface = 'co-simulation', output_interval = 0.1 }}
        inputs.throttle.control_points = 3
        parameters.finalDrive.range = [3, 3.5]
        requirements.R.formula = 'G (speed <= 200)'""")
    done = falsifier("simulate", "car.toml:R", "--inputs", "u.csv", cwd=tmp_path)
    assert "no values given for finalDrive: kept at the model's start value" in done.err
    done = falsifier("simulate", "car.toml:R", "--set", "finalDrive=3.2", cwd=tmp_path)
    assert "no values given for throttle" in done.err and "no inputs given" not in done.err


def test_a_problem_in_which_everything_is_fixed_is_simulated_but_not_searched(tmp_path: Path) -> None:
    lag = fixture("Lag_2")
    (tmp_path / "lag.toml").write_text(f"""
        model = {{ fmu = '{lag}', interface = 'co-simulation', stop_time = 1.0 }}
        inputs.u.value = 2.0
        requirements.R.formula = 'G (y <= 5)'
    """)
    done = falsifier("simulate", "lag.toml", "--json", cwd=tmp_path, code=0)
    assert "R: no inputs given" in done.err
    alone = falsifier("simulate", str(lag), "--stl", "G[0,1] (y <= 5)", "--json", cwd=tmp_path, code=0)
    assert alone.json["robustness"] > done.json["robustness"]
    assert "nothing to search" in falsifier("check", "lag.toml", cwd=tmp_path, code=2).err


def test_a_package_needs_no_ranges_for_own_inputs(tmp_path: Path) -> None:
    package = str(write(tmp_path / "plant.ssp", structure(system(PLANT)), "Plant_2"))
    formula = "G[0,1] (plant.y <= 5)"
    done = falsifier(
        "simulate", package, "--stl", formula, "--set", "plant.u=2", "--json", cwd=tmp_path, code=0
    )
    assert done.json["signals"]["plant.u"]["values"] == [2.0]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([EASY, "--set", "u=high"], "options cannot change"),
        ([EASY, "--set", "w=1"], "no parameter 'w'"),
        (["AT1", "--set", "throtle=100"], "did you mean 'throttle'?"),
        ([EASY, "--inputs", "none.csv"], "none.csv"),
        ([EASY, "--inputs", __file__], "expected a CSV file of inputs"),
        (["python:tests.problems:unusable", "--set", "u=1"], "out of order"),
    ],
)
def test_wrong_use_ends_with_two_and_a_failed_simulation_with_three(
    arguments: list[str], said: str, tmp_path: Path
) -> None:
    done = falsifier("simulate", *arguments, cwd=tmp_path)
    assert done.code == (3 if "unusable" in arguments[0] else 2) and said in done.err


def test_of_a_run_of_several_requirements_the_best_sample_for_this_one_is_simulated(tmp_path: Path) -> None:
    other = lag_problem("G[0,10] (x >= -2)", name="OTHER")
    _, result = falsify([other, easy()], "corners", budget=5, directory=tmp_path / "r")
    done = falsifier("simulate", EASY, "--inputs", "r", "--json", cwd=tmp_path, code=1)
    assert done.json["robustness"] == result.robustness


def test_a_run_starts_from_known_inputs_and_resumes_with_them(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("time,u\n0,7\n")
    outside = falsifier("run", EASY, "--inputs", "u.csv", cwd=tmp_path, code=2)
    assert "u.csv: input 'u' at t = 0 s: 7 is outside its range [-1, 1]" in outside.err
    (tmp_path / "u.csv").write_text("time,u\n0,1\n10,1\n")
    target = "python:tests.problems:impossible"
    start = ["--inputs", "u.csv", "--engine", "uniform", "--budget", "3", "--json"]
    done = falsifier("run", target, *start, "--out", "run", cwd=tmp_path, code=0)
    lines = [json.loads(line) for line in (tmp_path / "run" / "journal.jsonl").read_text().splitlines()]
    asked = [c["origin"] for line in lines if line["kind"] == "asked" for c in line["candidates"]]
    assert asked == ["known", "uniform", "uniform"]
    assert done.json["spent"]["simulations"] == 3
    journal = tmp_path / "run" / "journal.jsonl"
    first = journal.read_bytes().splitlines(keepends=True)[:3]  # as if killed after it
    journal.write_bytes(b"".join(first))
    assert falsifier("resume", "run", "--json", cwd=tmp_path, code=0).json["best"] == done.json["best"]
    assert falsifier("run", target, "--inputs", "run", *start[2:], cwd=tmp_path).code == 0
