import importlib.util
import shutil
import zipfile
from pathlib import Path

import pytest

from falsifier.errors import ModelError
from falsifier.fmu import FmuModel, read_info
from falsifier.fmu.archive import this_platform
from falsifier.fmu.build import build, compiler
from tests.fmu import fixtures
from tests.fmu.fixtures import ramp, run

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))) and importlib.util.find_spec("ziglang") is None,
    reason="no C compiler",
)


@needs_compiler
@pytest.mark.parametrize("name", ["Lag_2sources", "Lag_3sources"])
def test_sources_become_an_fmu_for_this_platform(tmp_path: Path, name: str) -> None:
    target = build(fixtures.path(name), tmp_path / "Lag.fmu")
    assert this_platform() in read_info(target).platforms
    built, known = FmuModel(target), fixtures.isolated(name.removesuffix("sources"))
    signals = {"u": ramp(1.0)}
    assert (
        run(built, ("y",), signals=signals)["y"].tolist() == run(known, ("y",), signals=signals)["y"].tolist()
    )
    built.close()


def test_an_fmu_without_sources_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"Lag_2\.fmu: contains no C sources"):
        build(fixtures.path("Lag_2"), tmp_path / "out.fmu")
    assert not list(tmp_path.iterdir())


@needs_compiler
def test_sources_that_do_not_compile_show_what_the_compiler_says(tmp_path: Path) -> None:
    broken = tmp_path / "broken.fmu"
    with zipfile.ZipFile(fixtures.path("Lag_2sources")) as source, zipfile.ZipFile(broken, "w") as target:
        for name in source.namelist():
            target.writestr(name, b"int broken = ;" if name == "sources/lag.h" else source.read(name))
    with pytest.raises(ModelError, match=r"do not compile with (?s:.*)error"):
        build(broken, tmp_path / "out.fmu")


def test_missing_source_files_are_named(tmp_path: Path) -> None:
    partial = tmp_path / "partial.fmu"
    with zipfile.ZipFile(fixtures.path("Lag_2sources")) as source, zipfile.ZipFile(partial, "w") as target:
        for name in source.namelist():
            if name != "sources/all.c":
                target.writestr(name, source.read(name))
    with pytest.raises(ModelError, match=r"source files all\.c are missing"):
        build(partial, tmp_path / "out.fmu")


def test_no_compiler_says_how_to_get_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(ModelError, match="pip install ziglang"):
        compiler()
