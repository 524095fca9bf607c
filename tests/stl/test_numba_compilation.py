import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from falsifier.stl import numba_compilation

CODE = """
import numba.core.caching as caching
cache = getattr(caching, "CacheImpl", None) or caching._CacheImpl
# As where neither the package's folder nor a home can be written.
cache._locator_classes = [k for k in cache._locator_classes if "UserProvided" in k.__name__]
from falsifier.stl.numba_compilation import compiled

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


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders have no owner here")
def test_a_temporary_folder_that_others_can_write_to_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    own = numba_compilation._own_temporary_folder()
    assert own is not None and own.stat().st_mode & 0o777 == 0o700
    own.chmod(0o777)
    assert numba_compilation._own_temporary_folder() is None
