import shutil
from pathlib import Path

import pytest

from falsifier.campaigns import Follower, Method, Progress, RunProgress
from falsifier.campaigns.progress import total
from falsifier.errors import JournalError
from falsifier.record.summary import RunStatus
from falsifier.search.budget import Spent


def run(
    name: str, status: RunStatus, *, best: float | None = None, spent: Spent | None = None
) -> RunProgress:
    return RunProgress(
        name=f"{name}-0",
        requirement=name,
        method=Method("uniform"),
        seed=0,
        status=status,
        reason="",
        best=best,
        spent=spent or Spent(),
    )


PROGRESS = Progress(
    (
        run("A", "falsified", best=-1.0, spent=Spent(simulations=3, cost=0.5)),
        run("B", "running", best=0.5, spent=Spent(simulations=4, cost=0.25)),
        run("A", "interrupted"),
        run("B", "not falsified", best=0.25),
        run("B", "failed"),
    )
)


def test_finished_are_those_with_nothing_left_to_do() -> None:
    assert PROGRESS.finished == 2
    assert [r.finished for r in PROGRESS.runs] == [True, False, False, True, False]
    assert PROGRESS.counts == dict.fromkeys(
        ["falsified", "running", "interrupted", "not falsified", "failed"], 1
    )


def test_requirements_have_progress_of_their_own_in_the_campaigns_order() -> None:
    parts = PROGRESS.by_requirement()
    assert list(parts) == ["A", "B"]
    assert (parts["A"].best, parts["B"].best, PROGRESS.best) == (-1.0, 0.25, -1.0)
    assert Progress((run("A", "waiting"),)).best is None


def test_what_was_spent_adds_up_and_an_unknown_cost_stays_unknown() -> None:
    assert (PROGRESS.spent.simulations, PROGRESS.spent.cost) == (7, 0.75)
    assert total([Spent(cost=0.5), Spent(cost=None, simulations=1)]) == Spent(cost=None, simulations=1)
    assert total([]) == Spent()


def test_following_a_finished_campaign_says_what_its_runs_say(campaign: Path) -> None:
    seen = Follower(campaign).look()
    assert seen.counts == {"falsified": 4, "not falsified": 4}
    assert [r.seed for r in seen.runs] == [0, 1] * 4
    assert {r.requirement for r in seen.runs if r.status == "falsified"} == {"hard"}
    assert seen.best is not None and seen.best < 0


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


def test_a_directory_of_no_campaign_is_refused(tmp_path: Path) -> None:
    with pytest.raises(JournalError):
        Follower(tmp_path)
