"""Runs whose language model reads named files: HeaterLimpHome in Modelica and in Simulink."""

from pathlib import Path

import pytest

from falsifier import falsify, resume
from falsifier.engines.briefing import preview
from falsifier.errors import JournalError, SpecError
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.loading import load_source
from falsifier.problem.source import ProblemSource
from falsifier.record import manifest
from falsifier.search.request import LLMSettings
from tests.fixtures import limp_home, simulink


def with_file(path: Path) -> ProblemSource:
    return ProblemSource(target="HeaterLimpHome", context=(str(path),))


@pytest.fixture(params=["limphome.slx", "limphome.mdl", "HeaterLimpHome.mo"])
def file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / str(request.param)
    if path.suffix == ".slx":
        return simulink.write_slx(path)
    path.write_text(simulink.MDL if path.suffix == ".mdl" else limp_home.SOURCE.read_text())
    return path


def test_a_model_that_reads_the_thresholds_falsifies_at_once(file: Path) -> None:
    result = falsify(with_file(file), llm=ScriptedChat(limp_home.reads_thresholds), budget=3)
    assert (result.status, result.spent.simulations) == ("falsified", 1)


def test_without_context_it_finds_nothing_to_aim_at() -> None:
    chat = ScriptedChat(limp_home.reads_thresholds)
    assert falsify("HeaterLimpHome", llm=chat, budget=1).status == "not falsified"
    assert "6.8" not in chat.requests[0].messages[0].content


def test_context_stands_in_the_part_that_does_not_change(file: Path) -> None:
    chat = ScriptedChat([limp_home.answer([0.0], [0.0]), limp_home.answer([0.0], [1.0])])
    falsify(with_file(file), llm=chat, budget=2)
    first, second = (request.messages[0].content for request in chat.requests)
    assert first == second
    assert f"--- {file.name} (" in first
    assert first == preview(load_source(with_file(file)), simulations=2)[0].content


def test_a_resumed_run_needs_no_file(file: Path, tmp_path: Path) -> None:
    place = tmp_path / "run"
    falsify(with_file(file), llm=ScriptedChat([limp_home.answer([0.0], [0.0])]), budget=1, directory=place)
    assert manifest.read(place).contexts["HeaterLimpHome"].excerpts[0].path == str(file)
    file.unlink()
    (result,) = resume(place, chat=ScriptedChat(limp_home.reads_thresholds), budget=2)
    assert (result.status, result.spent.simulations) == ("falsified", 2)


def test_a_resumed_run_reads_no_file_that_told_it_nothing(tmp_path: Path) -> None:
    file, place = tmp_path / "notes.c", tmp_path / "run"
    file.write_text("int f(void) { return 0; }\n")
    falsify(with_file(file), "surrogate", budget=1, directory=place)
    file.unlink()
    assert resume(place, budget=2)[0].spent.simulations == 2


def test_nothing_is_asked_or_recorded_if_a_file_looks_like_a_secret(tmp_path: Path) -> None:
    path, place = tmp_path / "notes.md", tmp_path / "run"
    path.write_text("password = hunter22\n")
    chat = ScriptedChat(limp_home.reads_thresholds)
    with pytest.raises(SpecError, match=r"notes\.md: line 1 looks like a key"):
        falsify(with_file(path), llm=chat, budget=1, directory=place)
    assert not chat.requests
    with pytest.raises(JournalError):
        manifest.read(place)


def test_context_and_anonymous_exclude_each_other(file: Path) -> None:
    hidden = LLMSettings(name="openai/x", api_base="http://127.0.0.1:1", anonymous=True)
    with pytest.raises(SpecError, match="anonymous hides what the system is, and context would tell it"):
        falsify(with_file(file), llm=hidden, budget=1)
    with pytest.raises(SpecError, match="the prompt variant MP4 does not tell it; use MP6"):
        falsify(with_file(file), llm=hidden.model_copy(update={"variant": "MP4"}), budget=1)


def test_numerical_engines_open_no_file() -> None:
    result = falsify(with_file(Path("no such file")), engine="uniform", budget=1)
    assert result.spent.simulations == 1
