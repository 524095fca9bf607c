"""Runs whose language model reads named files: HeaterLimpHome in Modelica and in Simulink."""

import json
import re
from pathlib import Path

import pytest

from falsifier import falsify, resume
from falsifier.core.files import bundled
from falsifier.engines.preview import preview
from falsifier.errors import JournalError, SpecError
from falsifier.llm.messages import ChatRequest
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.loading import load_source
from falsifier.problem.source import ProblemSource
from falsifier.search import manifest
from falsifier.search.request import LLMSettings
from tests.fixtures import simulink

LIMP = bundled("fmus").parent / "modelica" / "Faults" / "HeaterLimpHome.mo"
# How each kind of file states when limp-home mode begins, and between which pauses the fault shows.
_NUMBER = r"(\d+(?:\.\d+)?)"
_ENTER = rf"disagreement > (?:\w+ \(\w+ = )?{_NUMBER}"
_LEAST = rf"(?:age < |period < valid \(.*?valid = ){_NUMBER}"
_MOST = rf"(?:age >= |period >= settling \(.*?settling = ){_NUMBER}"


def reads_thresholds(request: ChatRequest) -> str:
    """Enter limp-home mode, leave it, and enter it again within the limits, if the prompt tells them."""
    found = [re.search(pattern, request.messages[0].content) for pattern in (_ENTER, _LEAST, _MOST)]
    if not all(found):
        return _answer([0.0], [10.0])
    enter, least, most = (float(each[1]) for each in found if each)
    again = 1.0 + 1.1 + (least + most) / 2
    return _answer([0.0, 1.0, again, again + 4.0], [enter + 0.4, 0.0, enter + 0.4, 0.0])


def _answer(times: list[float], values: list[float]) -> str:
    signal = {"name": "disagreement", "interpolation": "constant", "times": times, "values": values}
    return json.dumps({"rationale": "thresholds", "signals": [signal]})


def with_file(path: Path) -> ProblemSource:
    return ProblemSource(target="HeaterLimpHome", context=(str(path),))


@pytest.fixture(params=["limphome.slx", "limphome.mdl", "HeaterLimpHome.mo"])
def file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / str(request.param)
    if path.suffix == ".slx":
        return simulink.write_slx(path)
    path.write_text(simulink.MDL if path.suffix == ".mdl" else LIMP.read_text())
    return path


def test_a_model_that_reads_the_thresholds_falsifies_at_once(file: Path) -> None:
    result = falsify(with_file(file), llm=ScriptedChat(reads_thresholds), budget=3)
    assert (result.status, result.spent.simulations) == ("falsified", 1)


def test_without_context_it_finds_nothing_to_aim_at() -> None:
    chat = ScriptedChat(reads_thresholds)
    result = falsify("HeaterLimpHome", llm=chat, budget=1)
    assert result.status == "not falsified"
    assert "9.5" not in chat.requests[0].messages[0].content


def test_context_stands_in_the_part_that_does_not_change(file: Path) -> None:
    chat = ScriptedChat([_answer([0.0], [0.0]), _answer([0.0], [1.0])])
    falsify(with_file(file), llm=chat, budget=2)
    first, second = (request.messages[0].content for request in chat.requests)
    assert first == second
    assert f"--- {file} (" in first
    assert first == preview(load_source(with_file(file)), simulations=2)[0].content


def test_a_resumed_run_needs_no_file(file: Path, tmp_path: Path) -> None:
    place = tmp_path / "run"
    falsify(with_file(file), llm=ScriptedChat([_answer([0.0], [0.0])]), budget=1, directory=place)
    recorded = manifest.read(place).contexts["HeaterLimpHome"]
    assert recorded.excerpts[0].path == str(file)
    file.unlink()
    (result,) = resume(place, chat=ScriptedChat(reads_thresholds), budget=2)
    assert (result.status, result.spent.simulations) == ("falsified", 2)


def test_nothing_is_asked_or_recorded_if_a_file_looks_like_a_secret(tmp_path: Path) -> None:
    path, place = tmp_path / "notes.md", tmp_path / "run"
    path.write_text("password = hunter22\n")
    chat = ScriptedChat(reads_thresholds)
    with pytest.raises(SpecError, match=r"notes\.md: line 1 looks like a key"):
        falsify(with_file(path), llm=chat, budget=1, directory=place)
    assert not chat.requests
    with pytest.raises(JournalError):
        manifest.read(place)


def test_context_and_anonymous_exclude_each_other(file: Path) -> None:
    hidden = LLMSettings(name="openai/x", api_base="http://127.0.0.1:1", anonymous=True)
    with pytest.raises(SpecError, match="--anonymous hides what the system is, and context would tell it"):
        falsify(with_file(file), llm=hidden, budget=1)
    with pytest.raises(SpecError, match="the prompt variant MP4 does not tell it; use MP6"):
        falsify(with_file(file), llm=hidden.model_copy(update={"variant": "MP4"}), budget=1)


def test_numerical_engines_open_no_file() -> None:
    result = falsify(with_file(Path("no such file")), engine="uniform", budget=1)
    assert result.spent.simulations == 1
