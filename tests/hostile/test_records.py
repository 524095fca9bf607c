"""Records that somebody else wrote: what they name is not yet named by whoever continues or replays them."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from falsifier.counterexamples.case import counterexample_case
from falsifier.counterexamples.store import FILE_NAME, save, to_store
from falsifier.errors import JournalError
from falsifier.problem.loading import load_problem
from falsifier.record.run import falsify, resume

MODULE = """
from pathlib import Path
from falsifier.testing import lag_problem
Path(__file__).with_name("imported").touch()
problem = lag_problem("G[0,10] (x <= 0.5)", name="EASY")
"""
TARGET = "python:somebodys_module:problem"


@pytest.fixture
def theirs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with a run and the module that makes its problem; nobody has named it on this machine."""
    (tmp_path / "somebodys_module.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "their cache"))
    found = falsify(TARGET, "corners", budget=5, directory=tmp_path / "run").counterexample
    assert found is not None
    save(to_store(found), tmp_path / "run" / FILE_NAME)
    assert resume(tmp_path / "run")[0].falsified  # the author can
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    del sys.modules["somebodys_module"]
    (tmp_path / "imported").unlink()
    yield tmp_path
    sys.modules.pop("somebodys_module", None)


def test_a_module_that_only_a_record_names_is_not_imported(theirs: Path) -> None:
    for use in (resume, lambda run: counterexample_case(run).problem()):
        with pytest.raises(JournalError, match=f"nobody has named it.*{TARGET}"):
            use(theirs / "run")
    assert not (theirs / "imported").exists()
    load_problem(TARGET)
    assert resume(theirs / "run")[0].falsified and counterexample_case(theirs / "run").problem()


def test_a_module_of_the_same_name_in_another_place_is_another_one(
    theirs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    load_problem(TARGET)
    (theirs / "other").mkdir()
    (theirs / "somebodys_module.py").rename(theirs / "other" / "somebodys_module.py")
    monkeypatch.syspath_prepend(theirs / "other")
    del sys.modules["somebodys_module"]
    with pytest.raises(JournalError, match="nobody has named it"):
        resume(theirs / "run")
