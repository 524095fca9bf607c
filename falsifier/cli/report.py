"""``falsifier report`` and ``falsifier coverage``: what a run or campaign has recorded."""

import json
from pathlib import Path

import click

from falsifier.analyses.coverage import coverage as coverage_of_run
from falsifier.campaigns.archcomp import export
from falsifier.cli.command import command
from falsifier.cli.files import check_out, checked_picture, draw
from falsifier.cli.options import (
    directory_argument,
    json_option,
    out_option,
)
from falsifier.cli.output import say
from falsifier.record import manifest
from falsifier.views.analyses_text import coverage_json, coverage_text
from falsifier.views.report import html_report, junit_report, markdown_report, write_evaluations
from falsifier.views.terminal import warn


@command()
@click.argument(
    "directories", metavar="DIRECTORY...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
@out_option("Report to write; default: report.html in the first DIRECTORY.")
@click.option("--markdown", is_flag=True, help="Markdown instead of HTML; printed on stdout without --out.")
@click.option("--junit", type=click.Path(path_type=Path), metavar="FILE", help="Also write JUnit XML.")
@click.option(
    "--csv",
    "csv_file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Also write every evaluation: inputs, robustness, critical time, status.",
)
@click.option(
    "--parquet", type=click.Path(path_type=Path), metavar="FILE", help="The same as --csv in a Parquet file."
)
@click.option(
    "--arch-comp",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Also write a CSV file in the ARCH-COMP validation format.",
)
def report(
    *,
    directories: tuple[Path, ...],
    out: Path | None,
    markdown: bool,
    junit: Path | None,
    csv_file: Path | None,
    parquet: Path | None,
    arch_comp: Path | None,
) -> None:
    """Report on the run or campaign in DIRECTORY: one self-contained HTML page.

    Several directories are compared side by side: for example before and after a change, or two engines.
    """
    first, *others = directories
    if others and (junit is not None or arch_comp is not None):
        raise click.UsageError("--junit and --arch-comp take one DIRECTORY")
    if junit is not None:
        junit.write_text(junit_report(first), encoding="utf-8")
    if arch_comp is not None:
        arch_comp.write_text(export(first), encoding="utf-8")
    write_evaluations(directories, csv_file=csv_file, parquet=parquet)
    for written in filter(None, (junit, arch_comp, csv_file, parquet)):
        warn(f"{written} written")
    if markdown and out is None:
        say(markdown_report(*directories), nl=False)
        return
    path = out or first / "report.html"
    if path.is_file():
        check_out(path, beginnings=(b"# ",) if markdown else (b"<!DOCTYPE html>",))
    made = markdown_report(*directories) if markdown else html_report(*directories)
    path.write_text(made, encoding="utf-8")
    warn(f"{path} written")


@command()
@directory_argument
@out_option("Picture to write; default: coverage.png in DIRECTORY.")
@json_option
def coverage(*, directory: Path, out: Path | None, as_json: bool) -> None:
    """Show which part of the search space the run in DIRECTORY has tried, and how the system responded.

    This covers ranges of inputs and parameters, how fast inputs changed, combinations of two at the same
    time, values that outputs reached, modes and changes of mode. Nothing is simulated.
    """
    from falsifier.views.plotting import plot_coverage

    picture = directory / "coverage.png" if out is None else checked_picture(out)
    found, name = coverage_of_run(directory), ", ".join(manifest.read(directory).names)
    drawn = draw(lambda: plot_coverage(found, name), picture)
    if as_json:
        content = {"requirements": name, **coverage_json(found), "picture": drawn and str(drawn)}
        say(json.dumps(content, indent=2))
        return
    say(coverage_text(found, name))
    if drawn is not None:
        say(f"picture: {drawn}")
