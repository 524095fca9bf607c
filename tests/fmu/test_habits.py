"""What exporters do that a reader of the standard would not expect; one test FMU per habit."""

import shutil
import time
import zipfile
from pathlib import Path

import pytest

from falsifier.core.signals import Signal
from falsifier.errors import ModelError, SimulationError, SpecError
from falsifier.evaluation.evaluate import evaluate, simulate
from falsifier.fmu import FmuModel, read_info
from falsifier.problem.problem import Problem
from tests.fmu import fixtures
from tests.fmu.fixtures import isolated, run

ONE = {"u": Signal((0.0,), (1.0,))}
FAILS = {"u": Signal((0.0,), (6.0,))}


@pytest.mark.parametrize("name", ["StrictEnd_2", "StrictEnd_3"])
@pytest.mark.parametrize("stop", [1.0, 0.7, 4.3, 49.9])
def test_steps_end_at_the_stop_time_not_a_rounding_error_after_it(name: str, stop: float) -> None:
    model = isolated(name)
    for interval in (stop / 1000, stop / 300, stop / 7):
        for step_size in (interval, interval / 2):
            got = run(model, ("y",), stop=stop, interval=interval, step_size=step_size, signals=ONE)
            assert len(got) == round(stop / interval) + 1


def test_a_reset_that_corrupts_memory_is_not_used_again() -> None:
    model, fresh = isolated("Corrupts_2"), isolated("Lag_2")
    expected = run(fresh, ("y",), signals=ONE)["y"].tolist()
    for _ in range(8):
        assert run(model, ("y",), signals=ONE)["y"].tolist() == expected
    trust = fixtures.runner(model)
    assert (trust.reuse, trust.untrusted) == ("instance", ("reset",))


def test_a_reset_that_hangs_does_not_cost_the_time_limit() -> None:
    model = isolated("Hangs_2")
    started = time.perf_counter()
    first, second = (run(model, ("y",), signals=ONE, time_limit=600.0)["y"].tolist() for _ in range(2))
    assert first == second
    # The trial would be waited for five times as long as one simulation may take.
    assert time.perf_counter() - started < 300.0
    assert fixtures.runner(model).untrusted == ("reset",)
    run(model, ("y",), signals=ONE)
    assert fixtures.runner(model).reuse == "instance"


@pytest.mark.parametrize("name", ["Silent_2", "Silent_3"])
def test_a_failure_is_repeated_to_hear_what_the_model_says(name: str) -> None:
    model = isolated(name)
    run(model, ("y",), signals=ONE)
    with pytest.raises(
        SimulationError, match="its last message: error: the solver did not converge"
    ) as caught:
        run(model, ("y",), signals=FAILS)
    assert caught.value.log == ("error: the solver did not converge: the valve is open too far",)
    assert run(model, ("y",), signals=ONE).log == ()


def test_a_failed_instantiation_tells_the_models_words_and_that_it_needs_its_tool() -> None:
    model = isolated("NeedsTool_2")
    with pytest.raises(ModelError) as caught:
        run(model, ("y",))
    assert "no licence server answers on port 27000" in str(caught.value)
    assert "needs the exporting tool to be installed on this machine (Simulation Tool 12)" in str(
        caught.value
    )
    (note,) = read_info(fixtures.path("NeedsTool_2")).notes
    assert "co-simulation needs the exporting tool" in note


def test_a_model_that_runs_is_not_said_to_need_its_tool(tmp_path: Path) -> None:
    def claiming(text: bytes) -> bytes:
        return text.replace(b"<CoSimulation ", b'<CoSimulation needsExecutionTool="true" ')

    model = FmuModel(fixtures.altered(fixtures.path("Silent_2"), tmp_path / "a.fmu", claiming, ending=".xml"))
    with pytest.raises(SimulationError, match=r"the valve is open too far$"):
        run(model, ("y",), signals=FAILS)


@pytest.mark.parametrize("name", ["Table_1", "Table_2", "Table_3"])
def test_strings_can_be_set(name: str, tmp_path: Path) -> None:
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "gain.txt").write_text("2.5\n")
    (tmp_path / "my.toml").write_text(
        f"""
        [model]
        fmu = "{fixtures.path(name)}"
        stop_time = 1.0
        output_interval = 0.1
        [inputs.u]
        control_points = 2
        [parameters]
        fileName = "tables/gain.txt"
        [requirements.R]
        formula = "G[0,1] (y <= 2)"
        """
    )
    from falsifier.problem.loading import load_problem

    problem = load_problem(str(tmp_path / "my.toml"))
    assert problem.experiment.strings == (("fileName", str(tmp_path / "tables" / "gain.txt")),)
    assert simulate(problem, {"u": 1.0}).robustness == -0.5


def test_a_string_that_names_no_file_reaches_the_model_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "gain.txt"
    problem = Problem.from_fmu(
        fixtures.path("Table_2"), "G[0,1] (y <= 2)", parameters={"fileName": "gone.txt"}
    )
    file.write_text("2.5")
    assert simulate(problem, {"u": 1.0}, {"fileName": str(file)}).robustness == -0.5
    with pytest.raises(SpecError, match=r"parameters\.fileName: expected a text, got None"):
        simulate(problem, {}, {"fileName": None})  # type: ignore[dict-item]
    evaluation = simulate(problem, {"u": 1.0})
    assert evaluation.status == "failed" and "the table cannot be read" in evaluation.reason


def test_two_names_of_one_input_are_one_input() -> None:
    info = read_info(fixtures.path("Aliases_3"))
    assert [v.name for v in info.inputs] == ["u"]
    assert info["plant.u"].alias_of == "u" and not info["plant.u"].settable
    assert [v.name for v in info.outputs] == ["y", "plant.y"]
    assert info.notes == ("two names of one input: plant.u = u; use the second",)
    with pytest.raises(ModelError, match=r"'plant\.u' cannot be set: it is another name of 'u'"):
        run(isolated("Aliases_3"), ("y",), parameters={"plant.u": 1.0})


def test_clocks_and_binary_variables_are_ignored_and_named() -> None:
    info = read_info(fixtures.path("ClocksAndBinary_3"))
    assert [v.name for v in info.inputs] == ["u"]
    assert [v.name for v in info.outputs] == ["y"]
    assert info.notes == (
        "input clocks are ignored, so they never tick: request, every",
        "variables of clocks are ignored: command, sampled",
        "binary variables are ignored: image, frame",
    )
    model = isolated("ClocksAndBinary_3")
    twin = isolated("Lag_3")
    assert run(model, ("y",), signals=ONE)["y"].tolist() == run(twin, ("y",), signals=ONE)["y"].tolist()


def test_a_start_time_is_said() -> None:
    info = read_info(fixtures.path("LateStart_2"))
    assert info.start_time == 5.0
    assert info.notes == (
        "the default experiment starts at 5 s; here simulations start at 0 s and end at the stop time",
    )


def test_the_only_library_is_used_whatever_its_name_is() -> None:
    info = read_info(fixtures.path("OtherLibrary_2"))
    assert info.notes == (
        "its library is called plant_win_and_linux.so, not OtherLibrary.so; it is the only one, so it is "
        "used",
    )
    assert run(isolated("OtherLibrary_2"), ("y",), signals=ONE)["y"][-1] > 0


def test_of_several_libraries_none_is_guessed(tmp_path: Path) -> None:
    path = tmp_path / "two.fmu"
    shutil.copy(fixtures.path("OtherLibrary_2"), path)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("binaries/linux64/helper.so", b"not a library")
    (note,) = read_info(path).notes
    assert note.startswith("binaries/linux64 contains helper.so, plant_win_and_linux.so")
    with pytest.raises(ModelError, match=r"contains helper\.so, plant_win_and_linux\.so, but not Other"):
        run(FmuModel(path), ("y",))


def test_a_library_that_is_not_installed_is_named_when_it_is_needed(tmp_path: Path) -> None:
    good, path = fixtures.path("Lag_2"), tmp_path / "needy.fmu"
    fixtures.altered(good, path, lambda content: content.replace(b"libc.so.6", b"libq.so.6"))
    with pytest.raises(ModelError, match=r"the library cannot be loaded: libq\.so\.6: cannot open"):
        run(FmuModel(path), ("y",))


def test_repeated_folder_entries_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "folders.fmu"
    shutil.copy(fixtures.path("Lag_2"), path)
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        for _ in range(2):
            archive.writestr("resources/", b"")
    assert run(FmuModel(path), ("y",), signals=ONE)["y"][-1] > 0


def test_without_outputs_states_and_locals_are_observed() -> None:
    assert [v.name for v in read_info(fixtures.path("NoOutputs_2dymola")).observables] == ["x"]
    problem = Problem.from_fmu(fixtures.path("NoOutputs_2dymola"), "G[0,10] (y <= 5)")
    candidate = problem.space.decode([10.0] * len(problem.space.dimensions), origin="test")
    assert list(candidate.signals) == ["u"]
    evaluation = evaluate(problem, candidate)
    problem.model.close()
    assert evaluation.trajectory is not None
    assert evaluation.trajectory.names == ("x", "y", "u")
    assert evaluation.violated
