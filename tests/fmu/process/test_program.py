"""The program that runs FMUs."""

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from falsifier.errors import ModelError
from falsifier.fmu.description.archive import this_platform
from falsifier.fmu.process import workplace
from falsifier.fmu.process.connection import Request, Where
from falsifier.fmu.process.registry import REGISTRY, rights_text
from falsifier.fmu.process.worker import REUSES
from falsifier.fmu.process.workplace import WORKER
from tests.fmu import fixtures

EXPORT_PYTHON = Path(__file__).parents[3] / ".venv-export" / "bin" / "python"


def test_the_worker_is_built_from_its_sources() -> None:
    """`make worker` writes the sums of both."""
    lines = [line.split() for line in (WORKER / "SHA256SUMS").read_text().splitlines()]
    sums = {name: digest for digest, name in lines}
    files = {str(path.relative_to(WORKER)) for path in WORKER.rglob("*") if path.is_file()}
    assert sums.keys() == files - {"SHA256SUMS"}
    for name, expected in sums.items():
        assert hashlib.sha256((WORKER / name).read_bytes()).hexdigest() == expected, name


def numbered(source: str, enum: str) -> dict[str, int]:
    """What an enumeration of the sources says."""
    text = (WORKER / source).read_text().partition(f"enum {enum} {{")[2].partition("}")[0]
    names = "".join(line.split("/*")[0] for line in text.splitlines()).split(",")
    found, number = {}, 0
    for name, _, given in (each.partition("=") for each in names if each.strip()):
        number = int(given) if given else number
        found[name.strip()] = number
        number += 1
    return found


def test_places_and_requests_are_numbered_as_in_the_worker() -> None:
    assert numbered("worker.h", "where") == {where.name: int(where) for where in Where}
    assert numbered("main.c", "kind") == {kind.name: int(kind) for kind in Request}
    ways = numbered("session.h", "reuse")
    assert [f"BY_{reuse.upper()}" for reuse in REUSES] == list(ways)[:-1]


@pytest.mark.skipif(not EXPORT_PYTHON.exists(), reason="the compiler that builds the worker is not installed")
def test_the_sources_give_the_same_bytes_again(tmp_path: Path) -> None:
    platform = this_platform()
    target = f"bin/{platform}/worker"
    shutil.copytree(WORKER, tmp_path / "worker", ignore=shutil.ignore_patterns("bin"))
    subprocess.run(
        ["make", "--silent", f"ZIG='{EXPORT_PYTHON}' -m ziglang", target], cwd=tmp_path / "worker", check=True
    )
    assert (tmp_path / "worker" / target).read_bytes() == (WORKER / target).read_bytes()


@pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler")
class TestElsewhere:
    """On a platform for which nothing was built."""

    @pytest.fixture(autouse=True)
    def unknown_platform(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(workplace, "this_platform", lambda: "riscv64-linux")
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def test_the_machines_compiler_builds_it_once_and_it_simulates(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        model = fixtures.isolated("Lag_2")
        REGISTRY.close()
        compiled = fixtures.run(model, ("y",))["y"]
        REGISTRY.close()
        (kept,) = (tmp_path / "cache" / "falsifier" / "workers").iterdir()
        monkeypatch.setattr(workplace, "compile_c", None)
        assert workplace.worker_program(tmp_path / "of another process") == kept
        monkeypatch.undo()
        np.testing.assert_array_equal(compiled, fixtures.run(model, ("y",))["y"])

    def test_where_others_could_exchange_it_nothing_is_kept(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(
            workplace, "compile_c", lambda what, folder, arguments: Path(arguments[-1]).touch()
        )
        shared = tmp_path / "cache" / "falsifier" / "workers"
        shared.mkdir(parents=True)
        shared.chmod(0o777)
        assert workplace.worker_program(tmp_path).parent == tmp_path and not list(shared.iterdir())

    def test_without_compiler_one_line_says_so(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("PATH", str(tmp_path))
        monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
        with pytest.raises(ModelError, match=r"no program to run FMUs on riscv64-linux.*no C compiler found"):
            workplace.worker_program(tmp_path)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells it")
def test_a_program_that_may_start_no_other_one_says_which_limits_to_raise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As under ``ulimit -u``, which binds no administrator."""
    program = tmp_path / "worker"
    program.write_text("#!/bin/sh\nexit 71\n")
    program.chmod(0o700)
    monkeypatch.setattr(workplace.Workplace, "program", lambda *_, **__: program)
    REGISTRY.close()
    for attempt in (rights_text, partial(fixtures.run, fixtures.isolated("Lag_2"), ("y",))):
        with pytest.raises(
            ModelError, match=r"code 71\); end other processes, or raise the limits \(ulimit -u, "
        ):
            attempt()


def test_a_folder_that_forbids_programs_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    known = os.statvfs(tempfile.gettempdir())
    forbidding = os.statvfs_result([*known[:8], os.ST_NOEXEC, *known[9:]])
    monkeypatch.setattr(os, "statvfs", lambda folder: forbidding)
    REGISTRY.close()
    with pytest.raises(ModelError, match=rf"{tempfile.gettempdir()}.*noexec.*TMPDIR"):
        fixtures.run(fixtures.isolated("Lag_2"), ("y",))
