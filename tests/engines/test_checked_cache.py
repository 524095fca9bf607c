"""The cache of machine code after damage, after changes, and on a full disk."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from random import Random
from types import ModuleType

import pytest

from tests.command import ROOT
from tests.hostile.damage import DAMAGES

CODE = """
from falsifier.engines.numba_compilation import compiled

@compiled
def doubled(x):
    return 2.0 * x
"""


def imported(path: Path) -> ModuleType:
    """Import a file as a new process would."""
    spec = importlib.util.spec_from_file_location("cached_code", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_damaged_machine_code_is_compiled_again(tmp_path: Path) -> None:
    path = tmp_path / "cached_code.py"
    path.write_text(CODE)
    assert imported(path).doubled(4.0) == 8.0
    random = Random(2)
    for _ in range(4):
        files = sorted((tmp_path / "__pycache__").glob("*.nb[ic]"))
        assert len(files) == 2
        damaged = random.choice(files)
        damaged.write_bytes(random.choice(DAMAGES)(damaged.read_bytes(), random))
        assert imported(path).doubled(4.0) == 8.0
    again = imported(path).doubled
    assert again(4.0) == 8.0 and sum(again.stats.cache_hits.values()) == 1


def test_a_change_in_what_a_function_calls_makes_it_be_compiled_again(tmp_path: Path) -> None:
    (tmp_path / "callee.py").write_text(CODE)
    (tmp_path / "caller.py").write_text(
        "from callee import doubled\nfrom falsifier.engines.numba_compilation import compiled\n\n"
        "@compiled\ndef called(x):\n    return doubled(x) + 1.0\n"
    )
    program = (
        "import caller; called = caller.called; print(called(4.0), sum(called.stats.cache_hits.values()))"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}

    def printed() -> str:
        command = [sys.executable, "-c", program]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout

    assert [printed(), printed()] == ["9.0 0\n", "9.0 1\n"]
    (tmp_path / "callee.py").write_text(CODE.replace("2.0 * x", "2.0 * x + 0.5"))
    assert printed() == "9.5 0\n"


def test_a_cache_that_cannot_be_written_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    path = tmp_path / "cached_code.py"
    path.write_text(CODE)
    module = imported(path)
    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile._save_index", full)
    assert module.doubled(4.0) == 8.0


def test_what_is_cached_is_loaded_without_what_only_compiling_needs(tmp_path: Path) -> None:
    (tmp_path / "quick.py").write_text(CODE)
    program = "import sys, quick; print(quick.doubled(4.0), 'numba.np.linalg' in sys.modules)"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    command = [sys.executable, "-c", program]
    printed = [subprocess.check_output(command, text=True, env=environment) for _ in range(2)]
    assert printed == ["8.0 True\n", "8.0 False\n"]
