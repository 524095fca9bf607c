"""``falsifier report`` and ``falsifier coverage``: what a run or campaign has recorded."""

import json
from pathlib import Path

import click

from falsifier.analyses.coverage import coverage as coverage_of_run
from falsifier.campaigns.archcomp import export
from falsifier.cli.files import check_out, draw
from falsifier.cli.options import command, directory_argument, json_option, out_option
from falsifier.cli.output import say
from falsifier.record import manifest
from falsifier.views.coverage_text import coverage_json, coverage_text
from falsifier.views.report import html_report, junit_report, markdown_report
from falsifier.views.terminal import warn


@command()
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


@command()
@directory_argument
@out_option("Picture to write; default: coverage.png in DIRECTORY.")
@json_option
def coverage(*, directory: Path, out: Path | None, as_json: bool) -> None:
    """Show which part of the search space the run in DIRECTORY has tried, and what the system did.

    Ranges of inputs and parameters, how fast inputs changed, combinations of two at the same time, values
    that outputs reached, modes and changes of mode. Nothing is simulated.
    """
    from falsifier.views.plotting import plot_coverage

    found, name = coverage_of_run(directory), ", ".join(manifest.read(directory).names)
    picture = draw(lambda: plot_coverage(found, name), out or directory / "coverage.png")
    if as_json:
        content = {"requirements": name, **coverage_json(found), "picture": picture and str(picture)}
        say(json.dumps(content, indent=2))
        return
    say(coverage_text(found, name))
    if picture is not None:
        say(f"picture: {picture}")
