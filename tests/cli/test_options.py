"""Options that several commands share."""

import logging
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from falsifier.cli import cli
from falsifier.cli.options import quiet_option


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
        (["--seed", "-1"], "-1 is not in the range x>=0"),
        (["--jobs", "0"], "0 is not in the range x>=1"),
    ],
)
def test_options_that_cannot_be_used_are_wrong_usage(
    command: list[str], options: list[str], message: str, tmp_path: Path
) -> None:
    arguments = [*command, "python:tests.problems:easy", *options, "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(cli, arguments)
    assert (done.exit_code, message in done.output) == (2, True), done.output
    assert not (tmp_path / "out").exists()
