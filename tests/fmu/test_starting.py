"""What both ways of starting workers do before there is one."""

from pathlib import Path

import pytest

from falsifier.fmu import folders, starting
from falsifier.fmu.channel import open_channel, receive_reply
from falsifier.fmu.starting import open_folder, start_program

# A program with a module of the folder from which this process imports.
REPORTING = """
import os
from falsifier.core.operating_system import receive_connection
from falsifier.fmu.channel import Reply, send_reply

def main(root):
    sock, _ = receive_connection()
    send_reply(sock, Reply(text=f"{root.name} {os.environ.get('OPENAI_API_KEY')} {os.environ['COLOUR']}"))
"""


def test_a_program_has_this_process_s_modules_and_no_secrets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "reporting.py").write_text(REPORTING)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("OPENAI_API_KEY", "sk-secret-of-the-test")
    monkeypatch.setenv("COLOUR", "blue")
    ours, theirs = open_channel()
    child = start_program("reporting", tmp_path / "work", theirs)
    with ours:
        assert receive_reply(ours, 60.0).text == "work None blue"
    child.wait(60.0)
    assert child.end() == 0


def test_a_folder_is_made_once_the_machine_is_fit_and_old_folders_are_gone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    steps: list[str] = []
    monkeypatch.setattr(starting, "check_memory_limits", lambda: steps.append("limits"))
    monkeypatch.setattr(starting, "protect_secrets", lambda _: steps.append("secrets"))
    monkeypatch.setattr(folders, "sweep", lambda: steps.append("sweep"))
    folder = open_folder()
    assert steps == ["limits", "secrets", "sweep"]
    assert folder.path.is_dir()
    folder.remove()
    assert not folder.path.exists()
