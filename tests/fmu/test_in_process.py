import subprocess
import sys
from pathlib import Path

import pytest

from falsifier.errors import SimulationError
from falsifier.fmu.simulator import FmuModel
from tests.command import ROOT
from tests.fmu.fixtures import isolated, local, path, run
from tests.fmu.support import ERROR, TALK


@pytest.mark.parametrize("name", ["Lag_1cs", "Lag_2", "Lag_3", "Arrays_3"])
def test_it_gives_the_same_as_a_process_of_its_own(name: str) -> None:
    outputs = [v.name for v in local(name).info.outputs]
    here, there = (run(model, outputs) for model in (local(name), isolated(name)))
    assert {n: here[n].tolist() for n in here.names} == {n: there[n].tolist() for n in there.names}


@pytest.mark.parametrize("name", ["NoReset_2", "LyingReset_2", "SavedState_2", "LyingState_2"])
def test_repeated_runs_are_equal(name: str) -> None:
    model = local(name)
    runs = [run(model, ("y",))["y"].tolist() for _ in range(4)]
    assert runs == [runs[0]] * 4
    model.close()


def test_messages_belong_to_the_simulation_that_they_came_from() -> None:
    model = local("Misdeeds_2")
    with pytest.raises(SimulationError) as caught:
        run(model, ("y",), parameters={"misdeed": ERROR})
    assert caught.value.log == ("error: the tank is empty",)
    assert caught.value.status == "failed"
    got = run(model, ("y",), parameters={"misdeed": TALK, "moment": 0.85})
    assert got.log == ("warning: valve nearly closed",)
    assert run(model, ("y",)).log == ()
    model.close()


def test_the_messages_of_an_fmu_that_others_load_are_printed_when_this_one_is_closed() -> None:
    """fmpy has one logger per process: were it freed with its FMU, the next message would crash."""
    program = f"""
import gc
from tests.fmu.fixtures import local, run
from tests.fmu.support import TALK
from tests.modelica.support import opened
model = local("Misdeeds_2")
assert run(model, ("y",), parameters={{"misdeed": TALK}}).log
model.close()
gc.collect()
with opened({str(path("Misdeeds_2"))!r}) as [other]:
    other.start(misdeed=TALK).run(["y"], 1.0, 0.1)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.splitlines()) == {"warning: valve nearly closed"}


def test_equal_files_are_loaded_once_and_closing_removes_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(path("Ball_2").read_bytes() + b"\0")  # another file than the other tests have loaded
    models = [FmuModel(copy, isolate=False) for _ in range(2)]
    for model in models:
        run(model, ("h",))
    assert len([p for p in tmp_path.glob("falsifier-fmu-*") if p.is_dir()]) == 1
    models[0].close()
    assert not list(tmp_path.glob("falsifier-fmu-*"))
    models[1].close()
    assert len(run(models[1], ("h",))) == 11
    models[1].close()


def test_an_fmu_that_cannot_be_loaded_leaves_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def full(*_: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr("falsifier.fmu.description.archive.extract", full)
    copy = tmp_path / "copy.fmu"
    copy.write_bytes(path("Ball_2").read_bytes() + b"\0\0")
    with pytest.raises(OSError, match="no space"):
        run(FmuModel(copy, isolate=False), ("h",))
    assert not list(tmp_path.glob("falsifier-fmu-*"))
