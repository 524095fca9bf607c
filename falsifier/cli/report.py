"""``falsifier report`` and ``falsifier validate``."""

import json
from pathlib import Path

import click

from falsifier.campaigns.archcomp import Revalidated, export, read_rows
from falsifier.campaigns.archcomp import validate as check_rows
from falsifier.campaigns.suites import PROTOCOL_SIMULATIONS
from falsifier.cli.files import check_out
from falsifier.cli.options import budget_option, directory_argument, json_option, out_option
from falsifier.cli.output import conclude, say
from falsifier.core.literals import one_line
from falsifier.core.words import counted
from falsifier.stl.margins import signed
from falsifier.views.report import html_report, junit_report, markdown_report
from falsifier.views.terminal import warn


@click.command()
@directory_argument
@out_option("Report to write; default: report.html in DIRECTORY.")
@click.option("--markdown", is_flag=True, help="Markdown instead of HTML; printed on stdout without --out.")
@click.option("--junit", type=click.Path(path_type=Path), metavar="FILE", help="Also write JUnit XML.")
@click.option(
    "--arch-comp",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Also write a CSV file in the ARCH-COMP validation format.",
)
def report(
    *, directory: Path, out: Path | None, markdown: bool, junit: Path | None, arch_comp: Path | None
) -> None:
    """Report on the run or campaign in DIRECTORY: one self-contained HTML page."""
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
    if path.is_file():
        check_out(path, beginnings=(b"# ",) if markdown else (b"<!DOCTYPE html>",))
    path.write_text(markdown_report(directory) if markdown else html_report(directory), encoding="utf-8")
    warn(f"{path} written")


@click.command()
@click.argument("file", type=click.Path(path_type=Path, exists=True, dir_okay=False))
@budget_option(PROTOCOL_SIMULATIONS, note=" per run; claims that used more are rejected")
@json_option
def validate(*, file: Path, budget: int, as_json: bool) -> None:
    """Re-simulate the counterexamples in FILE and report which of them are reproduced.

    FILE is a CSV file in the validation format of the ARCH-COMP falsification category, written by any tool.

    Exit codes: 0 all accepted, 1 some rejected, 2 wrong usage or file.
    """
    findings = check_rows(read_rows(file), budget=budget)
    if as_json:
        text = json.dumps([_finding_json(f) for f in findings], indent=2)
    else:
        accepted = f"{sum(f.holds for f in findings)} of {counted(len(findings), 'counterexample')} accepted"
        text = "\n".join([*map(_finding_line, findings), accepted])
    conclude(text, 0 if all(f.holds for f in findings) else 1)


def _finding_line(f: Revalidated) -> str:
    rejected = "rejected: " if f.robustness is None else ""  # without a simulation the claim is invalid
    robustness = "" if f.robustness is None else f", robustness {signed(f.robustness)}"
    return one_line(f"row {f.row.number}, {f.row.requirement}: {rejected}{f.reason}{robustness}")


def _finding_json(finding: Revalidated) -> dict[str, object]:
    return {
        "row": finding.row.number,
        "requirement": finding.row.requirement,
        "holds": finding.holds,
        "robustness": finding.robustness,
        "claimed": finding.row.robustness,
        "reason": finding.reason,
    }
