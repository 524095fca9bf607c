import sys
from io import StringIO

import pytest

from falsifier.views.terminal import error_console, live_line, unbroken, warn


class Gone(StringIO):
    """A terminal that has been closed."""

    def write(self, _: str) -> int:
        raise OSError(5, "Input/output error")


def test_messages_are_plain_and_never_fail(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    warn("a\x1b]0;title\x07b")
    assert capsys.readouterr().err == "a\N{REPLACEMENT CHARACTER}]0;title\N{REPLACEMENT CHARACTER}b\n"
    monkeypatch.setattr(sys, "stderr", Gone())
    warn("nobody reads this")


def test_a_display_falls_silent_when_its_stream_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Gone())
    shown: list[str] = []
    console = error_console()

    def show(text: str) -> None:
        shown.append(text)
        console.print(text)

    display = unbroken(show)
    for text in ("a", "b", "c"):
        display(text)
    assert shown == ["a"]


def test_a_live_line_that_cannot_be_shown_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr(sys, "stderr", Gone())
    with live_line(error_console()) as update:
        update("shown to nobody")
