"""Runs led by a language model, their record and their resumption, against a server on this machine."""

import json
from pathlib import Path

import pytest

from falsifier.record.journal import read_journal
from falsifier.record.records import ExchangeRecord
from tests.cli.support import BRAKE_LATE, ENV, FULL, at1, reply
from tests.command import falsifier
from tests.llm.server import Step, serving
from tests.record.support import write_manifest


def test_two_replies_falsify_at1(tmp_path: Path) -> None:
    with serving(reply(BRAKE_LATE), reply(FULL, rationale="full throttle throughout")) as server:
        done = falsifier(*at1(server.url, "--out", "run"), "--json", cwd=tmp_path, env=ENV)
        first, second = (request.texts[-1] for request in server.received)
    assert done.code == 1, done.err
    found = done.json
    assert found["spent"]["simulations"] == found["spent"]["calls"] == 2
    assert found["counterexample"]["robustness"] == pytest.approx(-0.2133, abs=1e-3)
    assert found["counterexample"]["rationale"] == "full throttle throughout"
    assert "best robustness +0.418" in done.err
    assert "Sample" not in first
    for part in ("robustness 0.419", "82.5", "81.5", "20.0 s", "119.6"):
        assert part in second, part
    records = [r for r in read_journal(tmp_path / "run") if isinstance(r, ExchangeRecord)]
    assert records[1].exchange.messages[-1].content == second
    assert "full throttle throughout" in str(records[1].exchange.reply)
    everything = b"".join(p.read_bytes() for p in (tmp_path / "run").rglob("*") if p.is_file())
    assert b"sk-test-not-a-key" not in everything + done.err.encode() + done.out.encode()


def test_a_resumed_run_asks_for_nothing_twice(tmp_path: Path) -> None:
    with serving(reply(BRAKE_LATE), Step(status=401)) as server:
        broken = falsifier(
            *at1(server.url, "--out", "run", "--llm-option", "cache=no"), cwd=tmp_path, env=ENV
        )
        assert broken.code == 3
        assert "OPENAI_API_KEY" in broken.out
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    with serving(reply(FULL)) as server:
        manifest["request"]["llm"]["api_base"] = server.url
        write_manifest(tmp_path / "run", manifest)
        resumed = falsifier("resume", "run", "--json", cwd=tmp_path, env=ENV)
        assert len(server.received) == 1
        assert "robustness 0.419" in server.received[0].texts[-1]
    assert resumed.code == 1, resumed.err
    assert resumed.json["spent"]["calls"] == 2


def test_an_unknown_option_is_refused_before_the_first_simulation(tmp_path: Path) -> None:
    named = ("run", "AT1", "--llm", "openai/gpt-5-mini", "--out", "run", "--llm-option", "foo=1")
    done = falsifier(*named, cwd=tmp_path, env={"OPENAI_API_KEY": "sk-some-key"})
    assert (done.code, "--llm-option foo: openai has no such option" in done.err) == (2, True), done.err
    assert not (tmp_path / "run").exists()
