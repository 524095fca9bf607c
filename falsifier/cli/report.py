"""``falsifier report`` and ``falsifier coverage``: what a run or campaign has recorded."""

from collections.abc import Iterable
from os.path import realpath
from pathlib import Path

import click

from falsifier.analyses.coverage import coverage as coverage_of_run
from falsifier.campaigns.analysis import load
from falsifier.campaigns.archcomp import export
from falsifier.cli import files
from falsifier.cli.command import command, refuse
from falsifier.cli.options import PATH, directory_argument, json_option, out_option
from falsifier.cli.output import FAILED, as_shown, conclude, say
from falsifier.core.files import file_name
from falsifier.core.literals import csv_text
from falsifier.core.words import counted
from falsifier.record import manifest
from falsifier.search.result import Columns
from falsifier.views.analyses_text import coverage_json, coverage_text
from falsifier.views.plotting import plot_coverage
from falsifier.views.report import html_report, markdown_report
from falsifier.views.terminal import warn

# How a file in the ARCH-COMP validation format begins, and a table of evaluations.
_ARCH_COMP, _EVALUATIONS = b"system,", b"directory,requirement,"


@command()
@click.argument("directories", metavar="DIRECTORY...", nargs=-1, required=True, type=PATH)
@out_option("Report to write; default: report.html in the first DIRECTORY.")
@click.option("--markdown", is_flag=True, help="Markdown instead of HTML; printed on stdout without --out.")
@click.option(
    "--csv",
    "csv_file",
    type=PATH,
    metavar="FILE",
    help="Also write every evaluation: inputs, robustness, critical time, status.",
)
@click.option(
    "--arch-comp", type=PATH, metavar="FILE", help="Also write a CSV file in the ARCH-COMP validation format."
)
def report(
    *,
    directories: tuple[Path, ...],
    out: Path | None,
    markdown: bool,
    csv_file: Path | None,
    arch_comp: Path | None,
) -> None:
    """Report on the run or campaign in DIRECTORY: one self-contained HTML page.

    Several directories are compared side by side: for example before and after a change, or two engines.
    """
    first, *others = directories
    if others:
        refuse("takes one DIRECTORY", arch_comp=arch_comp)
    path = out or (None if markdown else first / "report.html")
    page, kind = (b"# Falsification report: ", ".md") if markdown else (b"<!DOCTYPE html>", ".html")
    outputs = ((arch_comp, _ARCH_COMP, ".csv"), (csv_file, _EVALUATIONS, ".csv"), (path, page, kind))
    named = [(file, begins, ending) for file, begins, ending in outputs if file is not None]
    if len({realpath(file) for file, _, _ in named}) < len(named):
        raise click.UsageError("--out, --csv and --arch-comp: expected a file for each, got one for two")
    for file, begins, ending in named:
        if file.parent != first:  # whether that is a run is seen when it is read
            files.in_existing_folder(file)
        if file.is_file() or file.is_dir():
            files.check_out(file, begins=begins)
        if file.suffix not in ("", ".txt", ".htm", ".markdown"):
            files.check_ending(file, (ending,))
    if arch_comp is not None:
        _write_arch_comp(first, arch_comp)
    if csv_file is not None:
        files.write_named(csv_file, _evaluations_csv(directories))
    made = markdown_report(*directories) if markdown else html_report(*directories)
    if path is None:
        say(made, nl=False)
    else:
        files.write_named(path, made)


@command()
@directory_argument
@out_option("Picture to write; default: coverage.png in DIRECTORY.")
@json_option
def coverage(*, directory: Path, out: Path | None, as_json: bool) -> None:
    """Show which part of the search space the run in DIRECTORY has tried, and how the system responded.

    This covers ranges of inputs and parameters, how fast inputs changed, combinations of two at the same
    time, values that outputs reached, modes and changes of mode. Nothing is simulated.
    """
    picture = directory / "coverage.png" if out is None else files.checked_picture(out)
    found, names = coverage_of_run(directory), manifest.read(directory).names
    name = ", ".join(names)
    drawn = files.draw(lambda: plot_coverage(found, name), picture)
    text = "\n".join([coverage_text(found, name), *(f"picture: {file}" for file in drawn)])
    content = {"requirements": names, **coverage_json(found), "files": list(map(str, drawn))}
    conclude(as_shown(text, content, as_json=as_json), FAILED if out and not drawn else 0)


def _write_arch_comp(directory: Path, path: Path) -> None:
    """Write the runs that have finished; those of several methods to a file each, named after its method."""
    runs = load(directory)
    finished = [run for run in runs if run.counts]
    if left_out := len(runs) - len(finished):
        warn(f"{path}: {counted(left_out, 'run')} not finished and left out")
    exported = export(finished)
    for label, text in exported.items():
        own = path if len(exported) == 1 else path.with_stem(f"{path.stem}-{file_name(label)}")
        files.check_out(own, begins=_ARCH_COMP)
        files.write_named(own, text)


def _evaluations_csv(directories: Iterable[Path]) -> str:
    """Return a row per evaluation: what identifies its run, then what Run.columns gives.

    What a run did not search has no value in its rows.
    """
    own = ("directory", "requirement", "method", "seed")
    runs = [
        (run, {f"{n} (varied)" if n in own else n: column for n, column in run.columns().items()})
        for directory in directories
        for run in load(directory)
    ]
    names = dict.fromkeys(name for _, columns in runs for name in columns)
    table: Columns = {name: [] for name in (*own, *names)}
    for run, columns in runs:
        count = len(columns["simulation"])
        about = {"requirement": run.requirement, "method": run.method.label, "seed": run.seed}
        about["directory"] = str(run.directory)
        for name, values in table.items():
            values += [about[name]] * count if name in about else columns.get(name, [None] * count)
    return csv_text([table, *zip(*table.values(), strict=True)])
