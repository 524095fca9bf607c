"""Language models on the command line: prompts, checks, runs and their record."""

import json
import re
from pathlib import Path

import pytest

from falsifier.record.journal import read_journal
from falsifier.record.records import ExchangeRecord
from tests.cli.support import BRAKE_LATE, ENV, FULL, at1, reply
from tests.command import falsifier
from tests.llm.server import Step, serving
from tests.record.support import write_manifest


def test_the_printed_prompt_is_what_is_sent(tmp_path: Path) -> None:
    text = falsifier("llm", "prompt", "AT1", "--variant", "MP4", cwd=tmp_path).out
    assert re.search(r"\d+ tokens; the first \d+ of them \(\d+%\) are the same in every question", text)
    printed = falsifier("llm", "prompt", "AT1", "--variant", "MP4", "--json", cwd=tmp_path)
    with serving(reply(FULL)) as server:
        falsifier(*at1(server.url), cwd=tmp_path, env=ENV)
        sent = server.received[0].body["messages"]
    assert printed.json == {"messages": sent}


def test_the_prompt_behind_a_run_can_be_printed(tmp_path: Path) -> None:
    with serving(reply(BRAKE_LATE), reply(FULL)) as server:
        falsifier(*at1(server.url, "--out", "run"), cwd=tmp_path, env=ENV)
        sent = server.received[1].body["messages"]
    rich = falsifier("llm", "prompt", "AT1", "--after", "run", cwd=tmp_path).out
    assert "2 of 100 simulations spent, 98 left. Propose the next sample." in rich
    at = falsifier("llm", "prompt", "run", "--at", "2", cwd=tmp_path)
    assert sent[1]["content"] in at.out and "--- reply of openai/" in at.out
    assert at.out.endswith("--- rationale of sample 2 ---\nbecause\n")
    no_run = falsifier("llm", "prompt", "AT1", "--at", "1", cwd=tmp_path, code=2)
    assert "AT1: not a run directory" in no_run.err
    none = falsifier("llm", "prompt", "run", "--at", "3", cwd=tmp_path, code=2)
    assert "the run has no sample 3: it has 2 samples" in none.err
    both = falsifier("llm", "prompt", "AT1", "--after", "run", "--at", "2", cwd=tmp_path, code=2)
    assert "--after: --at prints what a run sent" in both.err
    ignored = ("--variant", "MP1", "--parameterization", "fixed", "--stl", "G (speed <= 1)")
    stray = falsifier("llm", "prompt", "run", *ignored, "--at", "2", cwd=tmp_path, code=2)
    assert all(option in stray.err for option in ignored[::2])
    other = falsifier("llm", "prompt", "CC1", "--after", "run", cwd=tmp_path, code=2)
    assert "run is a run of AT1 on the model" in other.err


def test_check_reports_what_runs_need_and_fails_without_a_usable_answer(tmp_path: Path) -> None:
    good = Step('{"values": [1, 2, 3], "rationale": ""}')
    with serving(good, Step("one two", finish="length"), *[Step("ready")] * 2) as server:
        command = ("llm", "check", "openai/mine", "--api-base", server.url, "--llm-option", "top_k=3")
        limit = ("--llm-option", "timeout=20")
        done, unusable = (falsifier(*command, *limit, cwd=tmp_path, env=ENV) for _ in range(2))
        assert all(r.body["top_k"] == 3 for r in server.received)
    assert done.code == 0, done.err
    for part in ("openai/mine", "ok  answer: JSON", "ok  length: a reply", "240 tokens", "OPENAI_API_KEY"):
        assert part in done.out
    assert (unusable.code, "no usable answer came" in unusable.out) == (3, True)
    assert ENV["OPENAI_API_KEY"] not in done.out + done.err


def test_the_printed_prompt_has_the_context_that_is_named(tmp_path: Path) -> None:
    (tmp_path / "notes.md").write_text("The speed must not exceed 120 mph.")
    text = falsifier("llm", "prompt", "AT1", "--context", "notes.md", cwd=tmp_path).out
    assert "--- notes.md (whole) ---\nThe speed must not exceed 120 mph." in text
    (tmp_path / "notes.md").write_text("token:\n  sk-abcdefghijklmnop")
    done = falsifier("llm", "prompt", "AT1", "--context", "notes.md", cwd=tmp_path)
    assert (done.code, done.out) == (2, "")
    assert "context notes.md: line 2 looks like a key" in done.err
    assert "sk-abc" not in done.err
    assert "notes.md" not in falsifier("llm", "prompt", "AT1", cwd=tmp_path).out
    useless = falsifier("run", "AT1", "--engine", "cma", "--context", "notes.md", cwd=tmp_path, code=2)
    assert "--context: applies to language models and" in useless.err


def test_a_run_without_a_usable_answer_fails_and_says_why_in_the_last_line(tmp_path: Path) -> None:
    with serving(*[Step("[]")] * 6) as server:
        limits = ("--max-tokens", "200", "--llm-option", "price=1:1", "--llm-option", "cache=no")
        done = falsifier(*at1(server.url, *limits, "--out", "run"), cwd=tmp_path, env=ENV)
        again = falsifier(*at1(server.url, *limits, "--json"), cwd=tmp_path, env=ENV)
    assert (done.code, again.code, again.json["status"]) == (3, 3, "failed")
    last = done.out.splitlines()[-1]
    assert last.startswith("failed: the budget of 200 tokens is used up; the language model gave no usable")
    assert "nothing was simulated" in last


def test_two_replies_falsify_at1(tmp_path: Path) -> None:
    with serving(reply(BRAKE_LATE), reply(FULL, rationale="full throttle throughout")) as server:
        done = falsifier(*at1(server.url, "--out", "run"), "--json", cwd=tmp_path, env=ENV)
        first, second = (request.texts[-1] for request in server.received)
    assert done.code == 1, done.err
    found = done.json
    assert found["spent"]["simulations"] == found["spent"]["calls"] == 2
    assert found["counterexample"]["robustness"] == pytest.approx(-0.2133, abs=1e-3)
    assert found["counterexample"]["rationale"] == "full throttle throughout"
    assert f"engine openai/gpt-5-mini MP4, prompts go to {server.url}\n" in done.err
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
            *at1(server.url, "--out", "run", "--llm-option", "cache=no"), cwd=tmp_path, env=ENV, code=3
        )
        assert "OPENAI_API_KEY" in broken.out
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    with serving(reply(FULL)) as server:
        manifest["request"]["llm"]["api_base"] = server.url
        write_manifest(tmp_path / "run", manifest)
        refused = falsifier("resume", "run", cwd=tmp_path, env=ENV, code=2)  # nobody has named this address
        named = f"falsifier llm check openai/gpt-5-mini --api-base {server.url}"
        assert refused.err.strip().endswith(named) and not server.received
        resumed = falsifier(
            "resume", "run", "--json", cwd=tmp_path, env={**ENV, "OPENAI_API_BASE": server.url}
        )
        assert len(server.received) == 1
        assert "robustness 0.419" in server.received[0].texts[-1]
    assert resumed.code == 1, resumed.err
    assert resumed.json["spent"]["calls"] == 2


def test_an_unknown_option_is_refused_before_the_first_simulation(tmp_path: Path) -> None:
    named = ("run", "AT1", "--llm", "openai/gpt-5-mini", "--out", "run", "--llm-option", "foo=1")
    done = falsifier(*named, cwd=tmp_path, env={"OPENAI_API_KEY": "sk-some-key"}, code=2)
    assert "foo: openai has no such option; known: max_tok" in done.err and "_router" not in done.err
    assert not (tmp_path / "run").exists()
