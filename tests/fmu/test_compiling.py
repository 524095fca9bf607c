"""What is said of compiling, and where machine code is kept."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numba

from falsifier.fmu.compiling import on_compilation

# As where neither the package's folder nor a home can be written.
NO_FOLDER = """
import numba.core.caching as caching
cache = getattr(caching, "CacheImpl", None) or caching._CacheImpl
cache._locator_classes = [k for k in cache._locator_classes if "UserProvided" in k.__name__]
from falsifier.fmu import stepping
print(stepping.rounding(1.0))
"""


def doubled() -> Callable[[float], float]:
    """A function that is compiled at its first call."""
    double: Callable[[float], float] = numba.njit(lambda x: 2.0 * x)
    return double


def test_a_compilation_is_told_of_once_before_it_starts() -> None:
    told: list[str] = []
    double = doubled()
    with on_compilation(lambda: told.append(f"{len(double.signatures)} are compiled")):  # type: ignore[attr-defined]
        assert double(1.5) + doubled()(0.5) == 4.0
    assert told == ["0 are compiled"]


def test_what_is_compiled_already_is_not_told_of() -> None:
    told: list[str] = []
    double = doubled()
    double(1.0)
    with on_compilation(lambda: told.append("compiling")):
        assert double(2.0) == 4.0
    assert told == []


def test_the_loops_are_kept_in_a_temporary_folder_where_no_other_can_be_written(tmp_path: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment |= {"TMPDIR": str(tmp_path), "PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(
        [sys.executable, "-c", NO_FOLDER], env=environment, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "1e-11", done.stderr
    assert list(tmp_path.glob("falsifier-numba-*/**/*.nbi"))
