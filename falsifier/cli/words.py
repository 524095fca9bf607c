"""``falsifier lint``: what requirements say, before anything is searched."""

import json

import click

from falsifier.cli.options import json_option, profile_option
from falsifier.cli.output import conclude
from falsifier.core.literals import one_line
from falsifier.core.words import counted
from falsifier.search.lint import SIMULATIONS, LintFinding
from falsifier.search.lint import lint as find


@click.command()
@click.argument("target")
@profile_option
@click.option(
    "--simulations",
    type=click.IntRange(min=0),
    default=SIMULATIONS,
    show_default=True,
    help="Simulations that measure whether inputs move a requirement; 0: only what the FMU declares.",
)
@json_option
def lint(*, target: str, profile: str | None, simulations: int, as_json: bool) -> None:
    """Find requirements that say nothing: nothing moves them, or they cannot fail or hold.

    Also windows and parts that do not matter, units that do not fit, and requirements that repeat others. The
    exit code is 1 if something was found.
    """
    findings = find(target, profile=profile, simulations=simulations)
    code = 1 if findings else 0
    if as_json:
        conclude(json.dumps([finding.as_json() for finding in findings], indent=2), code)
    lines = [line for finding in findings for line in _lines(finding)]
    lines.append(f"{counted(len(findings), 'finding')}" if findings else "nothing found")
    conclude("\n".join(lines), code)


def _lines(finding: LintFinding) -> list[str]:
    head = f"{finding.requirement}: {finding.kind}: {one_line(finding.text)}"
    place = [f"  in      {finding.place}"] if finding.place else []
    return [head, *place, f"  to do   {finding.advice}"]
