"""The cache of machine code after damage, and on a full disk."""

import importlib.util
from pathlib import Path
from random import Random
from types import ModuleType

import pytest

from tests.hostile.damage import DAMAGES

CODE = """
from falsifier.stl.numba_compilation import compiled

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
