import logging
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from falsifier.cli import cli
from falsifier.cli.llm_options import llm_settings
from falsifier.cli.options import quiet_option, total_option
from falsifier.search.budget import Budget


def test_quiet_silences_what_simulates_until_the_command_ends() -> None:
    logger = logging.getLogger("falsifier.fmu")
    before, levels = logger.level, []

    @click.command()
    @quiet_option
    def command(*, quiet: bool) -> None:
        levels.append(logger.level)

    for arguments in (["--quiet"], []):
        assert CliRunner().invoke(command, arguments).exit_code == 0
        assert logger.level == before
    assert levels == [logging.ERROR, before]


@pytest.mark.parametrize("command", [["run"], ["bench"]])
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--seed", "-1"], "--seed -1: expected a whole number from 0 on"),
        (["--budget", "many"], "--budget 'many': expected a whole number from 1 to 10000000"),
        (["--max-cost", "1"], "--max-cost: applies to language models only; add --llm NAME"),
        (["--max-tokens", "10", "--max-cost", "1"], "--max-tokens, --max-cost: applies to language models"),
        (["--anonymous"], "--anonymous: applies to language models only"),
        (["--llm", "nobody/x", "--llm-option", "timeout=nan"], "timeout=nan: expected a number of seconds"),
        (["--llm", "nobody/x", "--llm-option", "price=2"], "price=2: expected SENT:RECEIVED, finite numbers"),
        (["--llm", "nobody/x", "--llm-option", "price=-1:2"], "price=-1:2: expected SENT:RECEIVED"),
        (["--llm", "nobody/x", "--llm-option", "price=nan:1"], "price=nan:1: expected SENT:RECEIVED"),
        (["--llm", "nobody/x", *2 * ("--llm-option", "x=1")], "--llm-option: a NAME is given twice"),
        (["--llm", "nobody/x", "--llm-option", "cache=maybe"], "cache=maybe: expected yes, or no"),
        (["--llm", "nobody/x", "--llm-option", "api_key=x"], "keys are read from the environment only"),
        (["--llm", "nobody/x", "--llm-option", "x=http://a:b@c"], "contains a user name or a password"),
    ],
)
def test_options_that_cannot_be_used_are_wrong_usage(
    command: list[str], options: list[str], message: str, tmp_path: Path
) -> None:
    arguments = [*command, "python:tests.problems:easy", *options, "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(cli, arguments)
    assert (done.exit_code, message in done.output) == (2, True), done.output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("value", "passed"), [("4000", 4000), ("-1", -1), ("0.5", 0.5), ("low", "low")])
def test_options_are_passed_as_numbers_or_as_text(value: str, passed: str | float) -> None:
    found = llm_settings({"llm": "x/y", "llm_options": [f"name={value}"]})
    assert found is not None and found.options == {"name": passed}


def test_a_total_limits_what_it_names_only() -> None:
    seen = []

    @click.command()
    @total_option
    def command(*, totals: object) -> None:
        seen.append(totals)

    for arguments in (["--total", "cost=5"], []):
        assert CliRunner().invoke(command, arguments).exit_code == 0
    assert seen == [Budget(None, cost=5.0), None]
    assert "expected simulations=N" in CliRunner().invoke(command, ["--total", "money=5"]).output
