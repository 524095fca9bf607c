"""All ways of asking, against llama.cpp's own server, with a language model that answers rubbish."""

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from falsifier.errors import ChatSetupError
from falsifier.llm import model_file
from falsifier.llm.client import LiteLLMChat
from falsifier.llm.connect import connect
from falsifier.llm.messages import UNREADABLE, Mode
from falsifier.llm.replies import ReplyForm
from falsifier.testing import START, lag_problem
from tests import patience
from tests.command import falsifier
from tests.llm.support import QUESTION
from tests.llm.test_client import SCHEMA
from tests.llm.tiny_model import FIRST_BYTE, write_tiny_model

# It ends most replies by itself.
SHORT = {"max_tokens": 600}
TEXT = QUESTION.model_copy(update={"reply_schema": SCHEMA})


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("xllamacpp", reason="llama.cpp's server comes with falsifier[llama]")
    file = tmp_path_factory.mktemp("llm") / "tiny.gguf"
    write_tiny_model(file)
    return file


@pytest.fixture(scope="module")
def server(model: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield model_file.served(str(model)).address
    model_file._end_all()


def chat(server: str, mode: Mode = "json_schema", **options: Any) -> LiteLLMChat:
    return LiteLLMChat("openai/tiny", api_base=server, options=SHORT | options, mode=mode)


def test_a_schema_is_enforced(server: str) -> None:
    reply = chat(server).complete(QUESTION)
    assert reply.parameters["mode"] == "json_schema"
    assert list(json.loads(reply.text)) == ["sum"]
    assert reply.usage.prompt_tokens > 10 and not reply.usage.estimated


def test_numbers_of_values_are_enforced(server: str) -> None:
    form = ReplyForm(lag_problem(inputs=2, parameters=[START]).space, count=3, lessons=True)
    request = QUESTION.model_copy(update={"reply_schema": form.schema()})
    answers = chat(server, "bounded_schema", max_tokens=2000)
    texts = [answers.send(request.model_copy(update={"sample": n})).text for n in range(3)]
    for text in texts:
        for one in json.loads(text)["candidates"]:
            assert [len(s["values"]) for s in one["signals"]] == [4, 4]
            assert len(one["parameters"]) == 1


def test_plainer_ways_and_replies_that_are_too_long(server: str) -> None:
    assert isinstance(json.loads(chat(server, "json_object", seed=1).complete(QUESTION).text), dict)
    words = chat(server, "prompt").complete(QUESTION)
    assert words.text and words.finish_reason in ("stop", "length")
    assert chat(server, max_tokens=3).complete(QUESTION).finish_reason == "length"


def test_a_reply_that_the_server_cannot_parse_is_one_that_cannot_be_used(server: str) -> None:
    ladder = chat(server, logit_bias={str(FIRST_BYTE + 0xFF): 24.0})
    replies = [ladder.complete(TEXT) for _ in range(2)]
    assert [reply.finish_reason for reply in replies] == [UNREADABLE, UNREADABLE]
    assert ladder.mode == "json_object"


@pytest.mark.usefixtures("model")
def test_a_prompt_beyond_the_models_context_is_never_cut(tmp_path: Path) -> None:
    write_tiny_model(tmp_path / "short.gguf", context=256)
    done = falsifier(
        *("run", "python:tests.problems:impossible", "--llm", "short.gguf", "--budget", "2", "--out", "run"),
        cwd=tmp_path,
        env={"XDG_CACHE_HOME": "cache"},
        code=3,
    )
    for part in ("the prompt is too long", "llama.cpp: --ctx-size", "(256 tokens)"):
        assert part in done.out, part
    assert "litellm" not in done.out


class TestModelFile:
    @pytest.fixture
    def model(self, model: Path, tmp_path: Path) -> Path:
        """A file that no other test serves."""
        return Path(shutil.copy(model, tmp_path))

    def test_a_file_is_served_for_a_run_and_recorded_by_its_path(self, model: Path, tmp_path: Path) -> None:
        done = falsifier(
            *("run", "python:tests.problems:impossible", "--llm", str(model), "--max-cost", "1"),
            *("--variant", "MP1", "--budget", "2", "--out", "run", "--llm-option", "max_tokens=200"),
            cwd=tmp_path,
            env={"XDG_CACHE_HOME": str(tmp_path / "cache")},
            code=3,
        )
        assert "failed after 2 simulations" in done.out
        assert "language model gave no usable answer" in done.out
        recorded = (tmp_path / "run" / "manifest.json").read_text()
        assert json.loads(recorded)["request"]["llm"]["name"] == str(model)
        assert "127.0.0.1" not in recorded + (tmp_path / "run" / "journal.jsonl").read_text()
        assert (tmp_path / "cache" / "falsifier" / "servers" / "tiny.log").stat().st_size
        patience.wait_until(lambda: not servers_of(model))

    def test_one_server_serves_this_process_and_those_that_it_starts(
        self, model: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(model_file, "_SERVERS", {})
        first = model_file.served(str(model))
        try:
            assert model_file.served(str(model)) == first
            code = f"from falsifier.llm.model_file import served; print(served({str(model)!r}).address)"
            child = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
            assert child.stdout.strip() == first.address
            assert len(servers_of(model)) == 1
        finally:
            model_file._end_all()
        again = model_file.served(str(model))
        assert again.address != first.address and again.content == first.content
        model_file._end_all()

    def test_what_cannot_be_served_is_told(self, model: Path, tmp_path: Path) -> None:
        with pytest.raises(ChatSetupError, match=r"none\.gguf: cannot read"):
            connect(str(tmp_path / "none.gguf"))
        (tmp_path / "text.gguf").write_text("hello")
        with pytest.raises(ChatSetupError, match="not a GGUF file"):
            connect(str(tmp_path / "text.gguf"))
        with pytest.raises(ChatSetupError, match="drop api_base"):
            connect(str(model), api_base="http://127.0.0.1:1/v1")
        odd = tmp_path / "odd.gguf"
        odd.write_bytes(model.read_bytes().replace(b"llama", b"lxama"))
        with pytest.raises(ChatSetupError, match="architecture 'lxama'"):
            connect(str(odd))

    def test_too_little_memory_and_a_missing_server_are_told_before_loading(
        self, model: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with monkeypatch.context() as patch:
            patch.setattr("falsifier.core.posix.machine_memory", lambda: 1 << 20)
            with pytest.raises(ChatSetupError, match="of memory"):
                connect(str(model))
        monkeypatch.setattr(model_file, "find_spec", lambda name: None)
        with pytest.raises(ChatSetupError, match=r"falsifier\[llama\]"):
            connect(str(model))


def servers_of(model: Path) -> list[int]:
    """Processes that serve a model file."""
    found = []
    for place in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            if {"falsifier.llm.model_file", str(model)} <= set(place.read_text().split("\0")):
                found.append(int(place.parent.name))
    return found
