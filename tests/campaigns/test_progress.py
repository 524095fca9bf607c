import shutil
from pathlib import Path

from falsifier.campaigns import Follower, RunProgress


def test_looks_see_what_was_written_in_between(campaign: Path, tmp_path: Path) -> None:
    copy = tmp_path / "c"
    shutil.copytree(campaign, copy)
    journal = sorted(copy.rglob("journal.jsonl"))[0]
    whole = journal.read_bytes()
    lines = whole.splitlines(keepends=True)
    journal.write_bytes(b"")
    follower = Follower(copy)
    name = journal.parent.name

    def seen() -> RunProgress:
        return next(r for r in follower.look().runs if r.name == name)

    assert (seen().status, seen().spent.simulations) == ("waiting", 0)
    journal.write_bytes(lines[0])
    assert (seen().status, seen().spent.simulations) == ("running", 0)
    journal.write_bytes(lines[0] + lines[1] + lines[2][:10])
    assert (seen().status, seen().spent.simulations) == ("running", 1)
    journal.write_bytes(whole)
    assert seen().finished
    journal.write_bytes(lines[0] + lines[1])
    assert (seen().status, seen().spent.simulations) == ("running", 1), "a shorter journal is another one"
