import sys

import pytest

from falsifier.cli.output import conclude, say


def test_results_have_no_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    say("a\x1b[2Jb\n", nl=False)
    assert capsys.readouterr().out == "a\N{REPLACEMENT CHARACTER}[2Jb\n"


def test_a_result_that_cannot_be_printed_keeps_its_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(sys.stdout, "write", full)
    with pytest.raises(SystemExit) as end:
        conclude("falsified", 1)
    monkeypatch.undo()
    assert end.value.code == 1
    assert "the result cannot be printed: No space left" in capsys.readouterr().err
