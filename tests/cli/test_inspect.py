import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from falsifier.cli import cli
from falsifier.core import posix_files
from falsifier.core.files import bundled
from falsifier.fmu import read_info
from falsifier.fmu.description.archive import this_platform
from falsifier.fmu.process.registry import REGISTRY
from tests.command import falsifier
from tests.fixtures import simulink
from tests.fmu.fixtures import path as fixture


def test_info_shows_units_ranges_and_descriptions(tmp_path: Path) -> None:
    done = falsifier("info", "AT.fmu", cwd=tmp_path, code=0)
    for part in ("FMI 2.0", "throttle", "%", "325", "ft.lbf", "Vehicle speed", "co-simulation, model-ex"):
        assert part in done.out
    described = falsifier("info", "AT.fmu", "--json", cwd=tmp_path).json
    assert {v["name"] for v in described["variables"]} >= {"throttle", "brake", "speed", "rpm", "gear"}


def test_info_says_what_is_ignored_and_what_cannot_be_simulated(tmp_path: Path) -> None:
    clocked = falsifier("info", str(fixture("Clocked_3")), cwd=tmp_path)
    assert "note: input clocks are ignored, so they never tick: tick" in clocked.out
    scheduled = falsifier("info", str(fixture("Scheduled_3")), cwd=tmp_path)
    assert "scheduled execution is not supported" in scheduled.out


def test_info_describes_an_fmu_where_none_can_be_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    REGISTRY.close()
    monkeypatch.setattr(posix_files, "forbids_programs", lambda folder: True)
    done = CliRunner().invoke(cli, ["info", str(fixture("Lag_2"))])
    assert done.exit_code == 0, done.output
    assert "cannot be simulated now" in done.output and "noexec" in done.output and "outputs" in done.output


def test_info_takes_a_bundled_requirement_or_a_spec_for_its_fmu(tmp_path: Path) -> None:
    assert falsifier("info", "AT1", "--json", cwd=tmp_path).json["name"].endswith("AT")
    assert "did you mean 'AT1'?" in falsifier("info", "at1", cwd=tmp_path).err
    spec = falsifier("info", str(bundled("specs") / "AT.toml"), cwd=tmp_path).out
    assert spec == falsifier("info", str(bundled("fmus") / "AT.fmu"), cwd=tmp_path).out
    assert spec == falsifier("info", f"{bundled('specs') / 'AT.toml'}:AT1", cwd=tmp_path).out
    (tmp_path / "s.toml").write_text("[model]\nfmu = 'AT'\n[requirements.R]\nformula = 'y <= 1'\n")
    missing = falsifier("info", "s.toml", cwd=tmp_path, code=2).err
    assert "s.toml: model.fmu: " in missing and "no such file" in missing


@pytest.mark.parametrize("given", [["."], ["/"], [".", "car.fmu"]])
def test_init_refuses_folders(tmp_path: Path, given: list[str]) -> None:
    done = falsifier("init", *given, cwd=tmp_path, code=2)
    assert f"{given[0]} is a folder; expected the path of an FMU" in done.err


def test_init_writes_a_spec_that_runs_once_its_requirement_is_filled_in(tmp_path: Path) -> None:
    shutil.copy(bundled("fmus") / "AT.fmu", tmp_path / "car.fmu")
    assert falsifier("init", "car.fmu", cwd=tmp_path).code == 0
    assert "delete it first" in falsifier("init", "car.fmu", cwd=tmp_path, code=2).err
    for command in (("check", "car.toml"), ("run", "car.toml", "--budget", "2"), ("run", "car.toml:R1")):
        asked = falsifier(*command, cwd=tmp_path, code=2)
        assert "requirements.R1.formula: LIMIT is a placeholder: write the number" in asked.err
    falsifier("run", "car.toml", "--stl", "G (speed <= 500)", "--budget", "1", cwd=tmp_path, code=0)
    path = tmp_path / "car.toml"
    path.write_text(path.read_text().replace("LIMIT", "500"))
    assert "R1: ok, " in falsifier("check", "car.toml", cwd=tmp_path).out
    assert falsifier("run", "car.toml", "--engine", "uniform", "--budget", "2", cwd=tmp_path).code == 0


def test_components_of_the_same_name_are_numbered_and_none_is_lost(tmp_path: Path) -> None:
    names = ("x/a.fmu", "z/a3.fmu", "y/a.fmu")
    for name in names:
        (tmp_path / name).parent.mkdir()
        shutil.copy(bundled("fmus") / "AT.fmu", tmp_path / name)
    falsifier("init", *names, "--out", "system.toml", cwd=tmp_path, code=0)
    assert all(name in (tmp_path / "system.toml").read_text() for name in names)


def test_init_writes_where_a_link_leads(tmp_path: Path) -> None:
    (tmp_path / "link.toml").symlink_to("spec.toml")
    falsifier("init", "AT", "--out", "link.toml", cwd=tmp_path, code=0)
    assert (tmp_path / "link.toml").is_symlink() and (tmp_path / "spec.toml").is_file()
    (tmp_path / "loop.toml").symlink_to("loop.toml")
    assert "already exists" in falsifier("init", "AT", "--out", "loop.toml", cwd=tmp_path, code=2).err


def test_nothing_is_written_for_an_fmu_that_cannot_be_simulated(tmp_path: Path) -> None:
    shutil.copy(fixture("Scheduled_3"), tmp_path)
    done = falsifier("init", "Scheduled_3.fmu", cwd=tmp_path, code=3)
    assert "scheduled execution is not supported" in done.err
    assert not (tmp_path / "Scheduled_3.toml").exists()


def test_build_writes_an_fmu_for_this_platform(tmp_path: Path) -> None:
    shutil.copy(fixture("Lag_2sources"), tmp_path / "lag.fmu")
    falsifier("tools", "build", "lag.fmu", "-o", "built.fmu", cwd=tmp_path, code=0)
    assert this_platform() in read_info(tmp_path / "built.fmu").platforms
    falsifier("tools", "build", "no.fmu", "-o", "x.fmu", cwd=tmp_path, code=2)
    assert not (tmp_path / "x.fmu").exists()


def test_an_fmu_without_outputs_can_be_checked_and_searched(tmp_path: Path) -> None:
    checked = falsifier("info", str(fixture("NoOutputs_2dymola")), "--check", cwd=tmp_path, code=0)
    assert "the FMU declares no outputs; these are its states or other computed variables" in checked.out
    assert "x changes by at most" in checked.out
    assert falsifier("init", str(fixture("NoOutputs_2dymola")), "--out", "my.toml", cwd=tmp_path).code == 0
    falsifier("run", "my.toml", "--stl", "G[0,10] (y <= 5)", "--budget", "5", "--quiet", cwd=tmp_path, code=1)


def test_info_of_a_simulink_file(tmp_path: Path) -> None:
    simulink.write_slx(tmp_path / "limphome.slx")
    done = falsifier("info", "limphome.slx", cwd=tmp_path, code=0)
    assert "Normal -> Limp [disagreement > 6.8 && disagreement < 7.2]" in done.out
    (tmp_path / "limphome.mdl").write_text(simulink.MDL)
    assert falsifier("info", "limphome.mdl", cwd=tmp_path).out == done.out
    assert falsifier("info", "limphome.slx", "--json", cwd=tmp_path).json["name"] == "limphome"
    assert falsifier("info", "limphome.slx", "--check", cwd=tmp_path).code == 2
    refused = falsifier("info", "AT", "--check", "--json", cwd=tmp_path, code=2)
    assert "--check, --json: the comparison is printed as text only; drop one of them" in refused.err
    refused = falsifier("info", "AT", "--all", "--json", cwd=tmp_path, code=2)
    assert "--all, --json: JSON shows all variables anyway; drop one of them" in refused.err
    (tmp_path / "bad.slx").write_bytes(b"PK")
    assert "bad.slx: not a readable Simulink file" in falsifier("info", "bad.slx", cwd=tmp_path, code=2).err


def test_a_spec_is_checked_at_its_own_step_without_what_it_omits(tmp_path: Path) -> None:
    fmu, model = fixture("Echo_2"), 'stop_time = 2.0\nstep_size = 0.25\nomit = ["out_Integer"]\n'
    (tmp_path / "s.toml").write_text(
        f"[model]\nfmu = '{fmu}'\n{model}[requirements.R]\nformula = 'out_Real < 1'\n"
    )
    checked = falsifier("info", "s.toml", "--check", cwd=tmp_path)
    assert "step 0.25 s compared with half of it over 2 s (a multiple of step_size = 0.25 s" in checked.out
    assert "out_Real changes" in checked.out and "out_Integer changes" not in checked.out
