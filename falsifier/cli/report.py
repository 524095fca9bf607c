"""``falsifier report`` and ``falsifier validate``."""

import sys
from pathlib import Path

import click

from falsifier.report import html_report, junit_report, markdown_report


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
        click.echo(f"{junit} written", err=True)
    if arch_comp is not None:
        from falsifier.archcomp import export

        arch_comp.write_text(export(directory), encoding="utf-8")
        click.echo(f"{arch_comp} written", err=True)
    if markdown and out is None:
        click.echo(markdown_report(directory), nl=False)
        return
    path = out or directory / "report.html"
    path.write_text(markdown_report(directory) if markdown else html_report(directory), encoding="utf-8")
    click.echo(f"{path} written", err=True)
