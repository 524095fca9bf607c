import json
import re
from pathlib import Path

from tests.cli.support import BRAKE_LATE, ENV, FULL, at1, reply
from tests.command import falsifier
from tests.llm.server import Step, serving


def test_the_printed_prompt_is_what_is_sent(tmp_path: Path) -> None:
    text = falsifier("llm", "prompt", "AT1", "--variant", "MP4", cwd=tmp_path).out
    assert re.search(r"\d+ tokens; the first \d+ of them \(\d+%\) are the same in every question", text)
    printed = falsifier("llm", "prompt", "AT1", "--variant", "MP4", "--json", cwd=tmp_path)
    with serving(reply(FULL)) as server:
        falsifier(*at1(server.url), cwd=tmp_path, env=ENV)
        sent = server.received[0].body["messages"]
    assert json.loads(printed.out) == sent


def test_the_prompt_behind_a_run_can_be_printed(tmp_path: Path) -> None:
    with serving(reply(BRAKE_LATE), reply(FULL)) as server:
        falsifier(*at1(server.url, "--out", "run"), cwd=tmp_path, env=ENV)
        sent = server.received[1].body["messages"]
    rich = falsifier("llm", "prompt", "AT1", "--after", "run", cwd=tmp_path).out
    assert "2 of 100 simulations spent, 98 left. Propose the next sample." in rich
    at = falsifier("llm", "prompt", "run", "--at", "2", cwd=tmp_path)
    assert sent[1]["content"] in at.out and "--- reply of openai/" in at.out
    assert at.out.endswith("--- rationale of sample 2 ---\nbecause\n")
    no_run = falsifier("llm", "prompt", "AT1", "--at", "1", cwd=tmp_path)
    assert (no_run.code, "AT1: not a run directory" in no_run.err) == (2, True)
    none = falsifier("llm", "prompt", "run", "--at", "3", cwd=tmp_path)
    assert (none.code, "the run has no sample 3" in none.err) == (2, True)
    both = falsifier("llm", "prompt", "AT1", "--after", "run", "--at", "2", cwd=tmp_path)
    assert (both.code, "--after: --at prints what a run sent" in both.err) == (2, True)
    other = falsifier("llm", "prompt", "CC1", "--after", "run", cwd=tmp_path)
    assert (other.code, "run is a run of AT1 on the model" in other.err) == (2, True)


def test_check_reports_what_runs_need_and_fails_without_a_usable_answer(tmp_path: Path) -> None:
    good = Step('{"values": [1, 2, 3], "rationale": ""}')
    with serving(good, Step("warm"), Step("one two", finish="length"), *[Step("ready")] * 3) as server:
        command = ("llm", "check", "openai/mine", "--api-base", server.url, "--llm-option", "top_k=3")
        limit = ("--llm-option", "timeout=20")
        done, unusable = (falsifier(*command, *limit, cwd=tmp_path, env=ENV) for _ in range(2))
        assert all(r.body["top_k"] == 3 for r in server.received)
    assert done.code == 0, done.err
    for part in ("openai/mine", "ok  answer: JSON", "no  tools: offered", "360 tokens", "OPENAI_API_KEY"):
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
    useless = falsifier("run", "AT1", "--engine", "cma", "--context", "notes.md", cwd=tmp_path)
    assert (useless.code, "--context: applies to language models and" in useless.err) == (2, True)


def test_a_run_without_a_usable_answer_fails_and_says_why_in_the_last_line(tmp_path: Path) -> None:
    with serving(*[Step("[]")] * 6) as server:
        limits = ("--max-tokens", "200", "--llm-option", "price=1:1", "--llm-option", "cache=no")
        done = falsifier(*at1(server.url, *limits, "--out", "run"), cwd=tmp_path, env=ENV)
        again = falsifier(*at1(server.url, *limits, "--json"), cwd=tmp_path, env=ENV)
    assert (done.code, again.code, again.json["status"]) == (3, 3, "failed")
    last = done.out.splitlines()[-1]
    assert last.startswith("failed: the budget of 200 tokens is used up; the language model gave no usable")
    assert "nothing was simulated" in last
