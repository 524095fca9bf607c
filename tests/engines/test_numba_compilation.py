import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from falsifier.engines.numba_compilation import compiled
from falsifier.errors import SpecError

CODE = """
import numba.core.caching as caching
cache = getattr(caching, "CacheImpl", None) or caching._CacheImpl
# As where neither the package's folder nor a home can be written.
cache._locator_classes = [k for k in cache._locator_classes if "UserProvided" in k.__name__]
from falsifier.engines.numba_compilation import compiled

@compiled
def double(x: float) -> float:
    return 2 * x

print(double(1.5))
"""


def test_the_cache_goes_to_a_temporary_folder_where_no_other_can_be_written(tmp_path: Path) -> None:
    script = tmp_path / "double.py"
    script.write_text(CODE)
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment |= {"TMPDIR": str(tmp_path), "PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(
        [sys.executable, script], env=environment, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "3.0", done.stderr
    assert list(tmp_path.glob("falsifier-numba-*/**/*.nbi"))


def test_a_setting_that_forbids_to_compile_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)
    with pytest.raises(SpecError, match="NUMBA_DISABLE_JIT is set"):
        compiled(lambda x: x)
