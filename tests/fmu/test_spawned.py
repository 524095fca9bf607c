import json
import os
import sys
from pathlib import Path

import pytest

from falsifier.core.operating_system import Child
from falsifier.fmu import folders, spawned
from falsifier.fmu.channel import open_channel, receive_reply
from tests.patience import HANG

PROGRAM = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from pathlib import Path
from falsifier.fmu import readiness, spawned
readiness.load_first = lambda tell: None
spawned.main(Path(sys.argv[2]))
"""


@pytest.mark.parametrize("first", ["line", "connection"])
def test_without_its_parent_it_removes_the_folder_and_ends(tmp_path: Path, first: str) -> None:
    root = tmp_path / "root"
    (root / "work").mkdir(parents=True)
    ours, theirs = open_channel()
    paths = json.dumps([str(Path(p).absolute()) for p in sys.path])
    child = Child([sys.executable, "-c", PROGRAM, paths, str(root)], os.environ, theirs)
    assert receive_reply(ours, HANG).status == "ok"
    child.settle()
    for what in (child._line, ours) if first == "line" else (ours, child._line):
        what.close()
    child.wait(HANG)
    assert child.end() == 1
    assert not root.exists()


def test_no_other_thread_may_end_the_process_while_the_folder_is_removed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """What the other thread waits for is ended first; that would end it too."""
    said: list[tuple[str, bool]] = []

    def note(what: str) -> None:
        said.append((what, folders.REMOVING.locked()))

    def leave(code: int) -> None:
        note("left")
        raise InterruptedError(code)

    monkeypatch.setattr("falsifier.core.operating_system.end_descendants", lambda: note("ended"))
    monkeypatch.setattr(spawned, "remove_work_folder", lambda _: note("removed"))
    monkeypatch.setattr(os, "_exit", leave)
    ours, theirs = os.pipe()
    os.close(theirs)
    with pytest.raises(InterruptedError):
        spawned._follow(ours, tmp_path)
    os.close(ours)
    assert said == [("ended", True), ("removed", True), ("left", True)]
