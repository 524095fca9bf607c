"""``falsifier report`` and ``falsifier validate``."""

import json
from pathlib import Path

import click

from falsifier.campaigns.archcomp import BUDGET, Finding, export, read_rows
from falsifier.campaigns.archcomp import validate as check_rows
from falsifier.cli.options import json_option
from falsifier.cli.output import conclude, say
from falsifier.core.literals import one_line
from falsifier.views.report import html_report, junit_report, markdown_report
from falsifier.views.terminal import warn


@click.command()
@click.argument("directory", type=click.Path(path_type=Path))
@click.option("-o", "--out", type=click.Path(path_type=Path), help="Page to write; default: in DIRECTORY.")
@click.option("--markdown", is_flag=True, help="Markdown instead of a page; on stdout without --out.")
@click.option("--junit", type=click.Path(path_type=Path), metavar="FILE", help="Write JUnit XML as well.")
@click.option(
    "--arch-comp",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write the competition's CSV as well.",
)
def report(
    *, directory: Path, out: Path | None, markdown: bool, junit: Path | None, arch_comp: Path | None
) -> None:
    """Report on the run or campaign in DIRECTORY: one page that needs nothing else."""
    if junit is not None:
        junit.write_text(junit_report(directory), encoding="utf-8")
        warn(f"{junit} written")
    if arch_comp is not None:
        arch_comp.write_text(export(directory), encoding="utf-8")
        warn(f"{arch_comp} written")
    if markdown and out is None:
        say(markdown_report(directory), nl=False)
        return
    path = out or directory / "report.html"
    path.write_text(markdown_report(directory) if markdown else html_report(directory), encoding="utf-8")
    warn(f"{path} written")


@click.command()
@click.argument("file", type=click.Path(path_type=Path, exists=True, dir_okay=False))
@click.option("--budget", type=int, default=BUDGET, show_default=True, help="Most simulations a run.")
@json_option
def validate(*, file: Path, budget: int, as_json: bool) -> None:
    """Re-simulate the counterexamples of FILE, ours or another tool's, and say which hold.

    FILE is in the validation format of the ARCH-COMP falsification category. Exit code 0: all hold; 1: some
    do not.
    """
    findings = check_rows(read_rows(file), budget=budget)
    if as_json:
        text = json.dumps([_finding_json(f) for f in findings], indent=2)
    else:
        lines = map(_finding_line, findings)
        text = "\n".join(
            [*lines, f"{sum(f.holds for f in findings)} of {len(findings)} counterexamples hold"]
        )
    conclude(text, 0 if all(f.holds for f in findings) else 1)


def _finding_line(f: Finding) -> str:
    robustness = "" if f.robustness is None else f", robustness {f.robustness:+.6g}"
    verdict = "holds" if f.holds else "does not hold"
    return one_line(f"row {f.row.number}: {f.row.requirement}: {verdict}: {f.reason}{robustness}")


def _finding_json(finding: Finding) -> dict[str, object]:
    return {
        "row": finding.row.number,
        "requirement": finding.row.requirement,
        "holds": finding.holds,
        "robustness": finding.robustness,
        "claimed": finding.row.robustness,
        "reason": finding.reason,
    }
