"""Records that somebody else wrote: what they name is not yet named by whoever continues or replays them."""

import json
import os
import shlex
import shutil
import sys
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from falsifier.campaigns import CampaignRequest, cross, resume_campaign
from falsifier.campaigns.directory import CampaignRecord, write_campaign
from falsifier.cli import cli
from falsifier.core.files import checksum, seal
from falsifier.counterexamples.case import counterexample_case
from falsifier.counterexamples.store import FILE_NAME, save, to_store
from falsifier.errors import ChatSetupError, JournalError
from falsifier.problem.loading import load_problem
from falsifier.problem.source import ProblemSource
from falsifier.record.manifest import environment
from falsifier.record.repair import repair
from falsifier.record.run import falsify, resume
from falsifier.search.budget import Budget
from falsifier.search.make_engines import check_llm, note_llm
from falsifier.search.request import LLMSettings
from falsifier.testing import lag_problem
from falsifier.views.report import html_report
from tests.llm.server import serving
from tests.record.support import write_manifest

MODULE = """
from pathlib import Path
from falsifier.testing import lag_problem
Path(__file__).with_name("imported").touch()
problem = lag_problem("G[0,10] (x <= 0.5)", name="EASY")
"""
TARGET = "python:somebodys_module:problem"


@pytest.fixture
def new_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache in which nothing is noted yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


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
        with pytest.raises(JournalError, match=f"nobody has named on this.*{TARGET}"):
            use(theirs / "run")
    assert not (theirs / "imported").exists()
    load_problem(TARGET)
    assert resume(theirs / "run")[0].falsified and counterexample_case(theirs / "run").problem()


@pytest.mark.usefixtures("at_the_command_line")
def test_the_command_that_the_refusal_states_names_a_module(theirs: Path) -> None:
    with pytest.raises(JournalError) as refused:
        resume(theirs / "run")
    command = shlex.split(str(refused.value).rpartition("name it first: python -m falsifier ")[2])
    assert CliRunner().invoke(cli, command).exit_code == 0
    assert resume(theirs / "run")[0].falsified


@pytest.mark.usefixtures("new_cache")
def test_the_command_that_the_refusal_states_names_a_server(tmp_path: Path) -> None:
    with serving() as server:  # its script has no answers, so the check itself fails
        theirs = LLMSettings(name="openai/x", api_base=server.url, options={"user": "a b", "store": True})
        other = LLMSettings(name="openai/y", api_base=server.url)
        with pytest.raises(ChatSetupError, match=r"openai/x at .* and openai/y at .* && falsifier llm check"):
            check_llm(tmp_path, theirs, other, other)
        with pytest.raises(ChatSetupError) as refused:
            check_llm(tmp_path, theirs)
        command = shlex.split(str(refused.value).rpartition("name it first: falsifier ")[2])
        CliRunner().invoke(cli, command)
        assert server.received
    check_llm(tmp_path, theirs)


def test_a_module_of_the_same_name_in_another_place_is_another_one(
    theirs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    load_problem(TARGET)
    (theirs / "other").mkdir()
    (theirs / "somebodys_module.py").rename(theirs / "other" / "somebodys_module.py")
    monkeypatch.syspath_prepend(theirs / "other")
    del sys.modules["somebodys_module"]
    with pytest.raises(JournalError, match="nobody has named"):
        resume(theirs / "run")


@pytest.mark.usefixtures("new_cache")
def test_a_server_that_only_a_record_names_is_not_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-test-not-a-key")
    falsify("AT1", "uniform", budget=1, directory=tmp_path / "run")
    described = json.loads((tmp_path / "run" / "manifest.json").read_text())
    (tmp_path / "run" / "journal.jsonl").unlink()
    with serving() as server:
        theirs = LLMSettings(name="openai/x", api_base=server.url, options={"user": "me", "n": 1})
        described["request"] |= {"engine": None, "llm": theirs.model_dump(mode="json")}
        write_manifest(tmp_path / "run", described | {"engine": "llm"})
        with pytest.raises(ChatSetupError, match=f"--api-base {server.url} --llm-option user=me$"):
            resume(tmp_path / "run")
        assert not server.received
        note_llm(theirs.model_copy(update={"options": {"user": "you"}}))
        with pytest.raises(ChatSetupError, match="nobody has named"):
            resume(tmp_path / "run")
        assert not server.received
        note_llm(theirs)
        assert resume(tmp_path / "run")[0].status == "failed"  # its script has no answers
        assert server.received


@pytest.mark.usefixtures("new_cache")
def test_nor_is_that_of_a_campaign(tmp_path: Path) -> None:
    theirs = LLMSettings(name="openai/x", api_base="http://127.0.0.1:9")
    runs = cross([ProblemSource(target="AT1")], [theirs], seeds=[0], budget=Budget(1))
    record = CampaignRecord(**environment(), request=CampaignRequest(runs=runs), hashes={})
    write_campaign(tmp_path / "campaign", record)
    with pytest.raises(ChatSetupError, match=r"llm check openai/x --api-base http://127\.0\.0\.1:9$"):
        resume_campaign(tmp_path / "campaign")


@pytest.mark.usefixtures("new_cache")
def test_a_server_that_the_environment_named_for_a_run_is_asked_without_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_BASE", "http://127.0.0.1:9")
    named = LLMSettings(name="openai/x")
    note_llm(named)
    monkeypatch.delenv("OPENAI_API_BASE")
    assert not named.is_usual
    check_llm(tmp_path, named)


def test_where_nothing_can_be_noted_the_message_says_what_to_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", os.devnull)
    named = LLMSettings(name="openai/x", api_base="http://127.0.0.1:9")
    note_llm(named)
    with pytest.raises(ChatSetupError, match=f"noted in {os.devnull}/.*: set XDG_CACHE_HOME if"):
        check_llm(tmp_path, named)


@pytest.mark.parametrize("name", ["openai/gpt-5-mini", "openai/own"])
def test_the_providers_own_server_and_that_of_the_environment_need_no_naming(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert LLMSettings(name=name, options={"max_tokens": 5}).is_usual
    recorded = LLMSettings(name=name, api_base="http://127.0.0.1:9")
    assert not recorded.is_usual
    monkeypatch.setenv("OPENAI_API_BASE", "http://127.0.0.1:9")
    assert recorded.is_usual
    assert not LLMSettings(name=name, api_base="http://127.0.0.1:8").is_usual
    assert not LLMSettings(name="/models/any.gguf").is_usual


def archive(save: Callable[..., None] = np.savez, **parts: Any) -> bytes:
    """What numpy writes, of a trajectory of x with some other parts."""
    buffer = BytesIO()
    times, columns = np.linspace(0.0, 10.0, 11), np.zeros((1, 11))
    names = {"names": np.array(["x"]), "units": np.array([""])}
    save(buffer, **{"times": times, "columns": columns, **names, **parts})
    return buffer.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        b"no archive",
        b"PK\3\4 and nothing else",
        archive(names=np.array(["x", "y"])),
        archive(columns=np.zeros((1, 5))),
        archive(times=np.array([object()])),
        archive(np.savez_compressed, columns=np.zeros((1, 1000)), times=np.arange(1000.0)),
        archive(columns=np.zeros((1, 1000))).replace(b"(1, 1000), }" + 10 * b" ", b"(1, 99999999999999), }"),
    ],
    ids=["text", "cut off", "too few", "too short", "pickle", "compressed", "huge"],
)
def test_a_trajectory_of_any_content_is_one_that_was_not_kept(content: bytes, tmp_path: Path) -> None:
    written(tmp_path, f"trajectories/0-{checksum(content)}.npz")
    (tmp_path / f"trajectories/0-{checksum(content)}.npz").write_bytes(content)
    assert "is damaged or missing" in html_report(tmp_path)
    assert not resume(tmp_path, problems=[lag_problem(name="EASY")])[0].falsified


def test_a_trajectory_without_the_signals_of_the_requirement_is_not_drawn(tmp_path: Path) -> None:
    content = archive(names=np.array(["y"]))
    written(tmp_path, f"trajectories/0-{checksum(content)}.npz")
    (tmp_path / f"trajectories/0-{checksum(content)}.npz").write_bytes(content)
    assert "is damaged or missing" in html_report(tmp_path)


@pytest.mark.parametrize("name", ["/dev/zero", "../x.npz", "trajectories/../0-0.npz", "manifest.json"])
def test_a_record_names_no_trajectory_elsewhere(name: str, tmp_path: Path) -> None:
    written(tmp_path, name)
    with pytest.raises(JournalError, match=r"line 2 .*: evaluated\.trajectory: String should match"):
        html_report(tmp_path)


def test_a_trajectory_that_is_a_link_or_a_pipe_is_not_read(tmp_path: Path) -> None:
    for name, make in (
        ("trajectories/0-0.npz", lambda path: path.symlink_to("/dev/zero")),
        ("trajectories/0-1.npz", os.mkfifo),
    ):
        written(tmp_path, name)
        make(tmp_path / name)
        assert "is damaged or missing" in html_report(tmp_path)
        assert len(repair(tmp_path)) == 1


def written(place: Path, trajectory: str) -> None:
    """Write a run of one simulation whose record names another trajectory."""
    shutil.rmtree(place / "trajectories", ignore_errors=True)
    (place / "journal.jsonl").unlink(missing_ok=True)
    (place / "manifest.json").unlink(missing_ok=True)
    falsify(lag_problem(name="EASY"), "uniform", budget=1, directory=place)
    for kept in (place / "trajectories").iterdir():
        kept.unlink()
    lines = [json.loads(line) for line in (place / "journal.jsonl").read_text().splitlines()]
    for line in lines:
        del line["sum"]
        if line["kind"] == "evaluated":
            line["trajectory"] = trajectory
    (place / "journal.jsonl").write_text("".join(seal(json.dumps(line)) for line in lines))
