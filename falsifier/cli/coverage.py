"""``falsifier coverage``: what a run has tried."""

import json
from pathlib import Path

import click

from falsifier.analyses.coverage import coverage as coverage_of_run
from falsifier.cli.files import draw
from falsifier.cli.options import directory_argument, json_option, out_option
from falsifier.cli.output import say
from falsifier.record import manifest
from falsifier.views.coverage_text import coverage_json, coverage_text


@click.command()
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
