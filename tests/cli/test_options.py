"""Options that several commands share."""

import logging

import click
from click.testing import CliRunner

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
