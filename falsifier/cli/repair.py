"""``falsifier repair``."""

from pathlib import Path

import click

from falsifier.campaigns.directory import is_campaign, read_campaign, run_directory
from falsifier.cli.options import directory_argument
from falsifier.cli.output import say
from falsifier.counterexamples.store import load
from falsifier.errors import JournalError, SpecError
from falsifier.record.journal import holds_run
from falsifier.record.repair import repair as repair_run
from falsifier.record.repair import set_aside


@click.command()
@directory_argument
def repair(*, directory: Path) -> None:
    """Repair the run or campaign in DIRECTORY after its files were damaged.

    Says what is wrong, keeps a copy of every file that is changed, and drops what is damaged; falsifier
    resume repeats it. A campaign's run that cannot be repaired is set aside, so that the campaign repeats it.
    """
    findings = _repair_campaign(directory) if is_campaign(directory) else _repair_run(directory)
    for finding in findings:
        say(finding)
    say("repaired" if findings else f"{directory}: nothing is damaged")


def _repair_campaign(directory: Path) -> list[str]:
    findings: list[str] = []
    for name in read_campaign(directory).runs:
        place = run_directory(directory, name)
        if not place.is_dir():
            continue
        try:
            findings += _repair_run(place) if holds_run(place) or any(place.iterdir()) else []
        except JournalError as error:
            findings.append(f"{error}; kept as {set_aside(place).name}, the campaign repeats it")
    return findings


def _repair_run(directory: Path) -> list[str]:
    findings = repair_run(directory)
    for path in sorted(directory.glob("counterexample*.json")):
        try:
            load(path)
        except SpecError as error:
            findings.append(f"{error}; kept as {set_aside(path).name}, falsifier replay writes it again")
    return findings
