from pathlib import Path

import pytest

from falsifier.core.ranges import Freedom
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.loading import load_problem, load_problems, load_source
from falsifier.problem.problem import Problem
from falsifier.problem.writing import subject_of
from tests.fmu.packages import PLANT, structure, system, write
from tests.problem.support import AT, GOOD, echo, spec


def test_at_is_bundled_with_its_ten_requirements() -> None:
    problems = load_problems("AT")
    assert [p.name for p in problems] == [
        *("AT1", "AT2", "AT51", "AT52", "AT53", "AT54", "AT6a", "AT6b", "AT6c", "AT6abc")
    ]
    at1 = load_problem("AT1")
    assert at1.requirement == problems[0].requirement
    assert len(at1.space.dimensions) == 10
    assert at1.experiment.stop_time == 50
    assert at1.experiment.outputs == ("speed", "rpm", "gear")
    assert (at1.space.inputs[0].unit, at1.space.inputs[1].high) == ("%", 325)


def test_a_shortest_piece_replaces_the_limits_of_the_spec() -> None:
    problem = load_problem("AT1", shortest_piece=2.5)
    assert {r.free for r in problem.space.inputs} == {Freedom(20, 2.5)}
    assert problem.source is not None and load_source(problem.source).space == problem.space
    with pytest.raises(SpecError, match="must be free, not fixed"):
        load_problem("AT1", parameterization="fixed", shortest_piece=2.5)
    with pytest.raises(SpecError, match=r"communication steps, 0\.01 s apart; give at least that"):
        load_problem("AT1", shortest_piece=1e-9)


def test_control_points_need_not_be_within_limits_that_are_not_used(folder: Path) -> None:
    limits = "control_points = 7\nfree = { max_control_points = 5, min_interval = 1.0 }"
    path = spec(folder, GOOD.replace("control_points = 7", limits))
    with pytest.raises(SpecError, match="7 control points are more than free allows"):
        load_problem(path)
    (throttle,) = load_problem(path, parameterization="fixed").space.inputs
    assert (throttle.control_points, throttle.free) == (7, None)
    (throttle,) = load_problem(path, shortest_piece=2.0).space.inputs
    assert (throttle.control_points, throttle.free) == (7, Freedom(25, 2.0))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"AT.fmu"', '"gone.fmu"', r"model\.fmu: .*gone\.fmu: no such file"),
        ('"AT.fmu"', r'"..\fmus\new.fmu"', r"model\.fmu: .* file; write backslashes of a path in sing"),
        ('"AT.fmu"', r'"C:\Users\a.fmu"', r"not valid TOML: .*; write backslashes, as of a path, in single"),
        ('"AT.fmu"', r'"C:\Docs\a.fmu"', r"not valid TOML: .*; write backslashes, as of a path, in single"),
        ("[inputs.throttle]", "[inputs.throtle]", r"inputs\.throtle: .*did you mean 'throttle'"),
        ("speed <=", "sped <=", r"requirements\.R\.formula: unknown signal 'sped'; did you mean 'speed'"),
        ("G[0,20]", "G[0,60]", r"requirements\.R\.formula: .*60 s"),
        ("G[0,20]", "G[0,20", r"requirements\.R\.formula: "),
        ("control_points", "range = [0, 120]\ncontrol_points", r"inputs\.throttle\.range: .* exceeds"),
        ("[inputs.throttle]", "[inputs.airLoad]", r"inputs\.airLoad: .*; write parameters in p"),
        ('"AT.fmu"', "“AT.fmu”", r"not valid TOML: .*: fmu = “AT.fmu”; write straight quotes"),
        ('"AT.fmu"', "AT.fmu", r"not valid TOML: .*: fmu = AT.fmu; write texts in quotes"),
        ('"AT.fmu"', '"AT.fmu"\nstop_time = 5,5', r"not valid .*: stop_time = 5,5; write decimals with a p"),
        ("[inputs.throttle]", "[inputs.u[1]]", r"not valid TOML: .*: \[inputs\.u\[1\]\]; quote names with"),
        ("[inputs.throttle]", "[inputs]\nu v.range = [0, 1]", r"not valid TOML: .*; quote names with"),
        ("[inputs.throttle]", "[inputs.throttle", r"not valid TOML: [^;]*: \[inputs\.throttle$"),
        ('fmu = "AT.fmu"', 'fmu "AT.fmu"', r'not valid TOML: [^;]*: fmu "AT\.fmu"$'),
        ("[inputs.throttle]", "[model]", r"not valid TOML: Cannot declare \[model\] twice .*; state every"),
        ("[inputs", '["at line 9"]\n["at line 9"]  # it’s a = b\n[inputs', r".*\]  # it’s a = b; state"),
        ("finalDrive", "finalDrve", r"parameters\.finalDrve: .*did you mean 'finalDrive'"),
        ("[parameters]", "[parameters]\nspeed = 3", r"parameters\.speed: cannot be set: the model computes"),
        ("interface", "output_interval = 0.03\ninterface", r"model\.output_interval: .*integer multiple"),
        ('interface = "co-simulation"', "", r"model\.interface: .*; set this key to one of them"),
    ],
)
def test_errors_name_file_key_and_cure(folder: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD
    with pytest.raises(SpecError, match=rf"my\.toml: {message}"):
        load_problem(spec(folder, GOOD.replace(old, new)))


def test_unknown_names_come_with_what_there_is() -> None:
    with pytest.raises(SpecError, match="did you mean 'AT1'"):
        load_problem("AT1x")
    with pytest.raises(SpecError, match="no requirement 'AT3'; did you mean"):
        load_problem("AT:AT3")
    with pytest.raises(SpecError, match=r"for example AT:AT1; falsify\(load_problems\('AT'\)\) searches"):
        load_problem("AT")
    with pytest.raises(
        SpecError, match=r"my\.fmu:R1: an FMU has no requirements of its own; .*init my\.fmu`"
    ):
        load_problem("my.fmu:R1")
    with pytest.raises(
        SpecError, match=r"'instance3'; did you mean 'instance2'.*; without a profile: free or fi"
    ):
        load_problem("AT1", profile="instance3")


def test_no_spec_is_needed(folder: Path) -> None:
    problem = Problem.from_fmu(
        folder / "AT.fmu",
        "G[0,20] (speed <= 120)",
        inputs={"throttle": (0, 100, 4, "linear"), "brake": 10},
        parameters={"finalDrive": (3, 3.5)},
        stop_time=20.0,
    )
    assert [d.name for d in problem.space.dimensions] == ["throttle"] * 4 + ["finalDrive"]
    assert problem.parameters == {"brake": 10}
    assert problem.experiment.stop_time == 20
    named = Problem.from_fmu(folder / "AT.fmu", "G[0,20] (speed <= 120)", inputs={"brake": None})
    assert [(r.name, r.low, r.high) for r in named.space.inputs] == [("brake", 0, 325)]
    every = Problem.from_fmu(folder / "AT.fmu", "G[0,20] (speed <= 120)")
    assert [r.name for r in every.space.inputs] == ["throttle", "brake"]


def test_an_fmu_has_no_profiles(folder: Path) -> None:
    with pytest.raises(SpecError, match=r"AT\.fmu: an FMU has no profile 'fast'"):
        load_problem(folder / "AT.fmu", stl="G[0,30] (speed <= 120)", profile="fast")


def test_endings_of_files_may_be_in_capital_letters(folder: Path) -> None:
    fmu = folder / "AT.fmu"
    fmu.rename(folder / "AT.FMU")
    assert load_problem(f"{folder}/AT.FMU", stl="G (speed <= 9)").model.info.name == "ArchComp.AT"
    with pytest.raises(SpecError, match="an FMU has no requirements of its own"):
        load_problem(f"{folder}/AT.FMU:R")
    package = write(folder / "PLANT.SSP", structure(system(PLANT)), "Plant_2")
    assert load_problem(str(package), stl="G (plant.y <= 9)", inputs={"plant.u": (0, 1)}, stop_time=1.0)
    assert [subject_of(f"{folder}/{name}").is_new for name in ("AT.FMU", "PLANT.SSP")] == [True, True]


def test_an_input_by_its_name_alone_is_as_the_spec_says(folder: Path) -> None:
    target = spec(folder, GOOD)
    assert load_problem(target, inputs={"throttle": None}).space == load_problem(target).space


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ("in_Int8 = {range = [-200, 100], control_points = 1}",
         r"echo.toml: inputs.in_Int8.range: \[-200, 100\] exceeds .* type Int8 of 'in_Int8', \[-128, 127\]"),
        ("in_UInt8 = {value = 256}", r"inputs.in_UInt8.value: 256 exceeds .* UInt8 .*, \[0, 255\]"),
        ("in_Boolean = {range = [0, 2], control_points = 1}", r"in_Boolean.range: .* type Boolean"),
        ("in_Enumeration = {range = [0, 3], control_points = 1}",
         r"exceeds the items \(1 = first, 2 = second, 3 = third\)"),
        ("in_Int8 = {value = 2.5}", r"in_Int8.value: 2.5: expected an integer"),
        ("in_Int8 = {range = [0.2, 0.8], control_points = 1}", r"contains no integer; widen the range"),
        ("in_Float64 = {control_points = 1}", r"range: the FMU specifies no min .*inputs=\{'in_Float64': \("),
        ("in_Int8 = {range = [0, 1], control_points = 2, interpolation = 'linear'}", r"integer cannot be"),
        ("in_Enumeration = {value = 0}", r"in_Enumeration.value: 0 exceeds the items"),
    ],
)  # fmt: skip
def test_numbers_that_a_type_cannot_hold_are_refused_when_loaded(
    tmp_path: Path, inputs: str, message: str
) -> None:
    with pytest.raises(SpecError, match=message):
        echo(tmp_path, inputs)


def test_whole_numbers_are_proposed_shown_and_simulated(tmp_path: Path) -> None:
    problem = echo(
        tmp_path,
        "in_Int8 = {range = [-3, 3], control_points = 2}\nin_Boolean = {control_points = 2}\n"
        "in_Enumeration = {control_points = 2}",
    )
    assert problem.space.bounds.tolist() == [[-3, 3]] * 2 + [[0, 1]] * 2 + [[1, 3]] * 2
    evaluation = evaluate(problem, problem.space.decode([-2.6, 2.4, 0.4, 0.6, 1.2, 2.9]))
    assert [s.values for s in evaluation.candidate.signals.values()] == [(-3, 2), (0, 1), (1, 3)]
    assert evaluation.trajectory is not None
    for name in ("Int8", "Boolean", "Enumeration"):
        inside = evaluation.trajectory[f"out_{name}"][1:-1]
        assert set(inside.tolist()) == set(evaluation.trajectory[f"in_{name}"][1:-1].tolist())


GRID = "[model]\noutput_interval = 0.01"
RISE = "rise signal=speed reference=80 time=10"


def test_a_template_becomes_the_formula_of_its_simulation() -> None:
    long = load_problem("AT1", stl=RISE)
    assert (long.name, str(long.requirement.formula)) == ("stl", "F[0,10] (speed >= 72)")
    dwell = "dwell condition='abs(gear - 3) <= 0.5' at_least=2.5"
    assert str(load_problem("AT1", stl=dwell).requirement.formula).startswith("G[0,47.49] ((not")
    overshoot = "overshoot signal=speed reference=80 at_most=10%"
    short = Problem.from_fmu(AT, overshoot, inputs={"throttle": (0, 100)}, stop_time=20.0)
    assert str(short.requirement.formula) == "G[0,20] (speed - 80 <= 8)"
    assert short.source is not None and load_source(short.source) == short


@pytest.mark.parametrize(
    ("target", "text", "message"),
    [
        ("AT1", RISE.replace("speed", "sped"), r"stl: unknown signal 'sped'; did you"),
        ("AT1", "rise signal=speed reference=80 time=51", r"stl: needs values up to 51 s"),
        (str(AT), "rise signal=sped reference=80 time=10", r"stl: unknown signal 'sped'"),
        ("AT1", "G ('speed' <= 120)", r"stl: unknown signal 'speed': .*; write speed"),
        ("AT1", f"{RISE} stop_time=10", r"^stl: stop_time: it changes .*\(stop_time, "),
        ("AT1", "ramp_limit signal=speed limit=9", r"unknown signal 'der\(speed\)'.*state over and range"),
        ("AT1", "not speed=9", r"equality is =="),
        ("python:tests.problems:easy", RISE, "made in Python"),
    ],
)
def test_errors_name_the_argument(target: str, text: str, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        load_problem(target, stl=text)


def test_a_spec_with_a_template_is_a_problem_with_its_formula(folder: Path) -> None:
    section = 'template = "settles"\nsignal = "speed"\nreference = 80\nwithin = "2%"\ntime = 3'
    text = GOOD.replace('formula = "G[0,20] (speed <= 120)"', section)
    problem = load_problem(spec(folder, text))
    assert str(problem.requirement.formula) == "G[3,50] (abs(speed - 80) <= 1.6)"
    with pytest.raises(
        SpecError, match=r"my.toml: requirements\.R\.template: unknown signal 'sped'; did you"
    ):
        load_problem(spec(folder, text.replace('"speed"', '"sped"')))
    with pytest.raises(SpecError, match=r"my.toml: requirements\.R\.template: .*not a multiple"):
        load_problem(spec(folder, text.replace("time = 3", "time = 3.005").replace("[model]", GRID)))
    with pytest.raises(SpecError, match=r"my.toml: requirements\.R: needs values up to 60 s"):
        load_problem(spec(folder, text.replace("time = 3", "time = 60")))


def test_of_several_requirements_that_simulate_differently_one_has_to_be_named(tmp_path: Path) -> None:
    text = GOOD.replace("[requirements.R]", "[requirements.R]\nstop_time = 30.0").replace(
        "AT.fmu", AT.as_posix()
    )
    more = f"{text}\n[requirements.S]\nformula = 'G[0,20] (speed <= 1)'\n"
    target = spec(tmp_path, more)
    within = "stays_within signal=speed high=120"
    with pytest.raises(SpecError, match=r"simulate in different ways.*:NAME, with one of R, S"):
        load_problem(target, stl=within)
    assert str(load_problem(f"{target}:R", stl=within).requirement.formula) == "G[0,30] (speed <= 120)"
    alike = spec(tmp_path, more.replace("stop_time = 30.0", ""))
    assert str(load_problem(alike, stl="G[0,9] (rpm <= 1)").requirement.formula) == "G[0,9] (rpm <= 1)"


def test_what_a_users_function_raises_is_said_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "raises_at_call.py").write_text("def boom():\n    raise KeyError('x')\n")
    (tmp_path / "raises_at_import.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(SpecError, match=r"boom\(\) raised KeyError: 'x' \(.*raises_at_call\.py, line 2\)"):
        load_problem("python:raises_at_call:boom")
    with pytest.raises(SpecError, match=r"importing raises_at_import raised ZeroDivisionError"):
        load_problem("python:raises_at_import:boom")
    (tmp_path / "ends.py").write_text("import sys\ndef boom():\n    sys.exit(0)\n")
    (tmp_path / "ends_at_import.py").write_text("import sys\nsys.exit(0)\n")
    (tmp_path / "no_number.py").write_text("\nboom = int('x')\n")
    for module, said in (
        ("ends", r"boom\(\) raised SystemExit: 0 \(.*ends\.py, line 3\)"),
        ("ends_at_import", r"importing ends_at_import raised SystemExit: 0 \(.*, line 2\)"),
        ("no_number", r"base 10: 'x' \(.*no_number\.py, line 2\)$"),
    ):
        with pytest.raises(SpecError, match=said):
            load_problem(f"python:{module}:boom")
