"""Options about language models."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from falsifier.cli import cli
from falsifier.cli.llm_options import read_llm_options


@pytest.mark.parametrize("command", [["run"], ["bench"]])
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--max-cost", "1"], "--max-cost: applies to language models only; add --llm NAME"),
        (
            ["--max-tokens", "10", "--max-cost", "1"],
            "--max-tokens, --max-cost: applies to language models only",
        ),
        (["--llm", "nobody/x", "--llm-option", "timeout=nan"], "timeout=nan: expected a number of seconds"),
        (
            ["--llm", "nobody/x", "--llm-option", "price=2"],
            "price=2: expected SENT:RECEIVED in US dollars per million tokens sent and received, for "
            "example 0.25:2",
        ),
    ],
)
def test_options_of_language_models_that_cannot_be_used_are_wrong_usage(
    command: list[str], options: list[str], message: str, tmp_path: Path
) -> None:
    arguments = [*command, "python:tests.problems:easy", *options, "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(cli, arguments)
    assert (done.exit_code, message in done.output) == (2, True), done.output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("value", "passed"), [("4000", 4000), ("0.5", 0.5), ("low", "low"), ("nan", "nan"), ("-inf", "-inf")]
)
def test_options_are_passed_as_finite_numbers_or_as_text(value: str, passed: str | float) -> None:
    assert read_llm_options([f"name={value}"]) == {"options": {"name": passed}}
