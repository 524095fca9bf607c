"""Records that somebody else wrote: what they name is not yet named by whoever continues or replays them."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from falsifier.campaigns import CampaignRequest, cross, resume_campaign
from falsifier.campaigns.directory import CampaignRecord, write_campaign
from falsifier.counterexamples.case import counterexample_case
from falsifier.counterexamples.store import FILE_NAME, save, to_store
from falsifier.errors import ChatSetupError, JournalError
from falsifier.problem.loading import load_problem
from falsifier.problem.source import ProblemSource
from falsifier.record.manifest import environment
from falsifier.record.run import falsify, resume
from falsifier.search.budget import Budget
from falsifier.search.make_engines import note_llm
from falsifier.search.request import LLMSettings
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


def test_a_server_that_only_a_record_names_is_not_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
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


def test_nor_is_that_of_a_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    theirs = LLMSettings(name="openai/x", api_base="http://127.0.0.1:9")
    runs = cross([ProblemSource(target="AT1")], [theirs], seeds=[0], budget=Budget(1))
    record = CampaignRecord(**environment(), request=CampaignRequest(runs=runs), hashes={})
    write_campaign(tmp_path / "campaign", record)
    with pytest.raises(ChatSetupError, match=r"llm check openai/x --api-base http://127\.0\.0\.1:9$"):
        resume_campaign(tmp_path / "campaign")


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
