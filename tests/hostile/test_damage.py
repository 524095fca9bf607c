"""Damage to any file of a run ends in the outcome of the undamaged run or in one clear line.

The damage is random with fixed seeds: flipped bits, cuts, deletions and doublings in every kind of file.
"""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest
from click.testing import CliRunner

from falsifier.campaigns import resume_campaign, run_campaign
from falsifier.campaigns.analysis import load as load_runs
from falsifier.campaigns.directory import campaign_lock
from falsifier.cli import cli
from falsifier.counterexamples.store import FILE_NAME, load_counterexample, save, to_store
from falsifier.errors import FalsifierError, JournalError, SpecError
from falsifier.llm.messages import ChatRequest
from falsifier.llm.scripted import ScriptedChat
from falsifier.record.journal import run_lock
from falsifier.record.repair import repair
from falsifier.record.run import falsify, resume
from falsifier.search.result import Result
from falsifier.testing import lag_problem
from falsifier.views.report.watch import Watch
from tests.campaigns.support import outcomes, request, work_in_threads
from tests.hostile.damage import DAMAGES, blank, cut, double_line, flip, lose_line
from tests.problems import hard, impossible


def answer(asked: ChatRequest) -> str:
    """Reply to a prompt in the same way whenever it is asked."""
    random = Random("".join(message.content for message in asked.messages))
    values = [round(random.uniform(-1, 0.5), 3) for _ in range(4)]
    return json.dumps({"rationale": "so", "signals": [{"name": "u", "values": values}]})


class Numeric:
    """Runs of an engine that draws at random; one of them finds a counterexample."""

    problem = staticmethod(hard)

    def run(self, directory: Path) -> Result:
        result = falsify(self.problem(), "uniform", seed=3, budget=25, directory=directory)
        assert result.counterexample is not None
        assert len(result.evaluations) > 3
        save(to_store(result.counterexample), directory / FILE_NAME)
        return result

    def resume(self, directory: Path) -> Result:
        return resume(directory, problems=[self.problem()])[0]


class Standing(Numeric):
    """Runs that find nothing."""

    problem = staticmethod(impossible)

    def run(self, directory: Path) -> Result:
        return falsify(self.problem(), "corners", budget=8, directory=directory)


class Led(Numeric):
    """Runs that a language model leads."""

    problem = staticmethod(lag_problem)

    def run(self, directory: Path) -> Result:
        return falsify(self.problem(), llm=ScriptedChat(answer), budget=6, directory=directory)

    def resume(self, directory: Path) -> Result:
        return resume(directory, problems=[self.problem()], chat=ScriptedChat(answer))[0]


def outcome(result: Result) -> tuple[object, ...]:
    """What damage must not change: everything but times."""
    seen = [(e.candidate.key, e.status, e.robustness, e.verdict) for e in result.evaluations]
    found = result.counterexample
    return result.status, result.reason, seen, found and (found.outcome, found.robustness, found.reference)


def damaged(whole: Path, place: Path, random: Random) -> str:
    """Copy a run directory and damage one file of the copy; say what was done."""
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(whole, place)
    files = sorted(p for p in place.rglob("*") if p.is_file() and p.stat().st_size)
    journal = place / "journal.jsonl"
    path = journal if random.random() < 0.6 else random.choice(files)
    if random.random() < 0.05:
        path.unlink()
        return f"{path.name} deleted"
    damage = random.choice(DAMAGES)
    for _ in range(random.choice((1, 1, 3))):
        path.write_bytes(damage(path.read_bytes() or b"\0", random))
    return f"{path.name}: {damage.__name__}"


def one_line_of(error: FalsifierError) -> str:
    """The message, which must be one line."""
    text = str(error)
    assert text and "\n" not in text and len(text) < 1000, text
    return text


@pytest.mark.parametrize("kind", [Numeric(), Standing(), Led()], ids=lambda kind: type(kind).__name__)
@pytest.mark.parametrize("seed", range(4))
def test_damage_ends_in_the_same_outcome_or_in_one_line(kind: Numeric, seed: int, tmp_path: Path) -> None:
    whole, place = tmp_path / "whole", tmp_path / "damaged"
    wanted = outcome(kind.run(whole))
    random = Random(seed)
    refused = 0
    for _ in range(25):
        what = damaged(whole, place, random)
        try:
            assert outcome(kind.resume(place)) == wanted, what
            continue
        except JournalError as error:
            one_line_of(error)
            refused += 1
        try:
            repair(place)
        except JournalError as error:
            assert "manifest" in one_line_of(error), what
            continue
        assert outcome(kind.resume(place)) == wanted, f"{what}, repaired"
        assert load_runs(place)[0].robustness.tolist() == load_runs(whole)[0].robustness.tolist(), what
        assert repair(place) == [], "once repaired, nothing is left to repair"
    assert refused > 3


def test_a_damaged_counterexample_file_is_never_another_counterexample(tmp_path: Path) -> None:
    Numeric().run(tmp_path / "run")
    path = tmp_path / "run" / FILE_NAME
    whole, content = load_counterexample(path), path.read_bytes()
    random = Random(5)
    for _ in range(300):
        path.write_bytes(random.choice((flip, cut, lose_line, double_line, blank))(content, random))
        try:
            assert load_counterexample(path) == whole
        except SpecError as error:
            one_line_of(error)


def test_a_journal_without_its_manifest_is_refused(tmp_path: Path) -> None:
    Standing().run(tmp_path)
    (tmp_path / "manifest.json").unlink()
    with pytest.raises(JournalError, match=r"contains no manifest\.json"):
        Standing().resume(tmp_path)
    with pytest.raises(JournalError, match="a journal without its manifest"):
        Standing().run(tmp_path)


@pytest.mark.parametrize("part", ["journal.jsonl", "trajectories"])
@pytest.mark.parametrize("change", [Standing().resume, repair], ids=["resume", "repair"])
def test_nothing_outside_a_run_is_changed_through_its_links(
    part: str, change: Callable[[Path], object], tmp_path: Path
) -> None:
    place, outside, theirs = tmp_path / "run", tmp_path / "outside", tmp_path / "outside" / "thesis.npz"
    Standing().run(place)
    (place / part).rename(outside)
    (place / part).symlink_to(outside)
    if outside.is_dir():
        theirs.write_bytes(b"no trajectory of a run")
    before = sorted(outside.rglob("*")), (theirs if outside.is_dir() else outside).read_bytes()
    with pytest.raises(JournalError, match=f"{part} is a link.*{outside}, in its place"):
        change(place)
    assert before == (sorted(outside.rglob("*")), (theirs if outside.is_dir() else outside).read_bytes())


def test_the_request_to_stop_is_written_to_the_run_and_not_through_a_link(tmp_path: Path) -> None:
    Standing().run(tmp_path / "run")
    (tmp_path / "theirs").write_text("kept")
    (tmp_path / "run" / "stop").symlink_to(tmp_path / "theirs")
    Watch(tmp_path / "run").stop()
    assert (tmp_path / "theirs").read_text() == "kept" and (tmp_path / "run" / "stop").read_text()


@pytest.mark.parametrize(
    "content", [b"", b"[]", b"{}", b"\xff\xfe", b"null", b"[" * 100_000, b'{"a": ' + b"9" * 5000 + b"}"]
)
def test_a_manifest_that_is_none_gives_one_line(content: bytes, tmp_path: Path) -> None:
    Standing().run(tmp_path)
    (tmp_path / "manifest.json").write_bytes(content)
    attempts: tuple[Callable[[Path], object], ...] = (Standing().resume, load_runs, repair)
    for attempt in attempts:
        with pytest.raises(JournalError, match=r"manifest\.json is damaged") as error:
            attempt(tmp_path)
        one_line_of(error.value)


def test_a_damaged_run_costs_itself_and_not_its_campaign(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    work_in_threads(monkeypatch)
    run_campaign(request("hard", "impossible", seeds=2, budget=10), tmp_path / "whole")
    random = Random(11)
    runs = sorted((tmp_path / "whole" / "runs").iterdir())
    for name in ("manifest.json", "journal.jsonl"):
        shutil.rmtree(tmp_path / "c", ignore_errors=True)
        shutil.copytree(tmp_path / "whole", tmp_path / "c")
        path = tmp_path / "c" / "runs" / runs[0].name / name
        path.write_bytes(flip(path.read_bytes()[:-3], random) + path.read_bytes()[-3:])
        with pytest.raises(JournalError, match=r"falsifier tools repair \S+/c\b"):
            load_runs(tmp_path / "c")
        with monkeypatch.context() as there, pytest.raises(JournalError, match="falsifier tools repair"):
            there.chdir(path.parent)
            load_runs(".")
        with campaign_lock(tmp_path / "c"):
            busy = CliRunner().invoke(cli, ["tools", "repair", str(tmp_path / "c")])
        assert isinstance(busy.exception, JournalError)
        other = tmp_path / "c" / "runs" / runs[-1].name / "journal.jsonl"
        other.write_bytes(flip(other.read_bytes(), random))
        with run_lock(path.parent):  # what another process writes to stays where it is
            busy = CliRunner().invoke(cli, ["tools", "repair", str(tmp_path / "c")])
        assert f"{path.parent}: left, as another process is writing to this run" in busy.stderr
        assert busy.exit_code == 2 and path.exists()
        assert f"{other}: line" in busy.stdout and busy.stdout.endswith("\nrepaired\n")
        done = CliRunner().invoke(cli, ["tools", "repair", str(tmp_path / "c")])
        assert done.exit_code == 0, done.output
        resume_campaign(tmp_path / "c")
        assert outcomes(tmp_path / "c") == outcomes(tmp_path / "whole")


def test_a_damaged_campaign_file_gives_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    work_in_threads(monkeypatch)
    run_campaign(request("impossible", seeds=1, budget=2), tmp_path)
    path = tmp_path / "campaign.json"
    content = path.read_bytes()
    for seed in range(30):
        path.write_bytes(Random(seed).choice((flip, cut, lose_line, blank))(content, Random(seed)))
        if path.read_bytes().split() == content.split():
            continue
        with pytest.raises(JournalError, match=r"campaign\.json") as error:
            load_runs(tmp_path)
        one_line_of(error.value)
