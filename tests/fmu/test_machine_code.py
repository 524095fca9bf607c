"""Machine code in files: found again, compiled again if damaged, and loaded without numba."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from falsifier.errors import ModelError
from falsifier.fmu import compiling, machine_code
from falsifier.fmu.compiling import FREES_ARRAYS
from falsifier.fmu.machine_code import SOURCES, Code, keep, kept
from tests.command import ROOT

CODE = Code("symbol", ("sqrt",), b"\0machine\ncode")
NAME = "co_simulation"
# Only its types are used.
_NOT_COMPILED = {"ports"}

LOADING = """
import sys
from falsifier.fmu import machine_code
from falsifier.fmu.readiness import load_first
load_first(print)
machine_code.load("model_exchange")
print("numba" in sys.modules)
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return tmp_path


def test_what_was_kept_is_found_and_replaces_what_is_outdated(folder: Path) -> None:
    assert kept(NAME) is None
    keep(NAME, CODE)
    assert kept(NAME) == CODE
    assert kept("model_exchange") is None
    (file,) = folder.iterdir()
    start, _, sources = file.name.rpartition("-")
    outdated, elsewhere = folder / f"{start}-0{sources}", folder / file.name.replace("-", "-other")
    outdated.touch()
    elsewhere.touch()
    keep(NAME, CODE)
    assert set(folder.iterdir()) == {file, elsewhere}, "that of another machine stays"


def test_what_others_write_or_use_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folders = [tmp_path / "first", tmp_path / "second"]
    monkeypatch.setattr(machine_code, "_folders", lambda: iter(folders))
    keep(NAME, CODE)
    (file,) = folders[0].iterdir()
    partial, used = file.with_name(f"{file.name}.1.partial"), file.with_name(file.name.replace(".o", "0.o"))
    partial.touch()
    used.mkdir()  # cannot be removed, as on Windows a file that is in use
    keep(NAME, CODE)
    assert {*folders[0].iterdir()} == {file, partial, used}
    assert not folders[1].exists()


@pytest.mark.parametrize("damage", [b"", b"short", b"x" * 100])
def test_damaged_machine_code_is_as_if_it_were_not_there(folder: Path, damage: bytes) -> None:
    keep(NAME, CODE)
    (file,) = folder.iterdir()
    file.write_bytes(damage)
    assert kept(NAME) is None


def test_one_changed_byte_is_noticed(folder: Path) -> None:
    keep(NAME, CODE)
    (file,) = folder.iterdir()
    content = bytearray(file.read_bytes())
    content[-1] ^= 1
    file.write_bytes(content)
    assert kept(NAME) is None


def test_a_folder_that_takes_nothing_is_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    folders = [tmp_path / "file", tmp_path / "second", tmp_path / "third"]
    monkeypatch.setattr(machine_code, "_folders", lambda: iter(folders))
    keep(NAME, CODE)
    assert kept(NAME) == CODE
    assert not folders[2].exists()


def test_a_file_belongs_to_its_sources(monkeypatch: pytest.MonkeyPatch) -> None:
    before = machine_code._sources(NAME)
    assert machine_code._sources(NAME) == before != machine_code._sources("model_exchange")
    monkeypatch.setattr(machine_code, "_numba_version", lambda: b"another")
    assert machine_code._sources(NAME) != before


@pytest.mark.parametrize("name", SOURCES)
def test_the_sources_of_an_entry_are_complete(name: str) -> None:
    package = Path(machine_code.__file__).parent
    for module in SOURCES[name]:
        tree = ast.parse((package / f"{module}.py").read_text(encoding="utf-8"))
        imported = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        near = {m.rpartition(".")[2] for m in imported if m.startswith("falsifier.fmu.")}
        assert near <= {*SOURCES[name], *_NOT_COMPILED}, module


def test_functions_that_are_not_there_are_named() -> None:
    with pytest.raises(ModelError, match="need no_such_function, which this system lacks"):
        machine_code._resolve(("sqrt", "no_such_function"))


def test_a_compiled_function_can_be_called_from_its_object_file() -> None:
    compiled = compiling.compiled_object(lambda what, number: 2 * what + number, machine_code._machine())
    assert machine_code._callable(Code(*compiled))(20, 2) == 42


def test_what_numba_does_with_arrays_of_its_own_stays() -> None:
    """The loops' stand-in for numba's function must not take its place in this process."""
    import numba
    from llvmlite import binding

    assert numba.njit(lambda n: np.ones(n).sum())(3) == 3.0
    before = binding.address_of_symbol("NRT_MemInfo_call_dtor")
    assert before
    machine_code._resolve((FREES_ARRAYS,))
    assert binding.address_of_symbol("NRT_MemInfo_call_dtor") == before
    machine_code.load(NAME)
    code = kept(NAME)
    assert code is not None and set(code.needed) <= {FREES_ARRAYS}


def test_workers_need_no_compiler() -> None:
    for name in SOURCES:
        machine_code.load(name)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", LOADING], env=environment, capture_output=True, text=True)
    assert done.stdout == "False\n", done.stderr
