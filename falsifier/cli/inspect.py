"""``falsifier info``, ``init``, ``build``, ``check`` and ``schema``: commands that do not search."""

import json
import shlex
import sys
from dataclasses import asdict
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from falsifier.cli.options import json_option, out_option, profile_option
from falsifier.cli.output import say
from falsifier.core.files import bundled
from falsifier.core.literals import one_line
from falsifier.core.model import Experiment, ModelInfo, Variable
from falsifier.core.signals import Signal
from falsifier.core.words import counted
from falsifier.errors import SpecError
from falsifier.problem.defaults import default_interface, default_interval
from falsifier.problem.loading import load_problems
from falsifier.problem.problem import Problem
from falsifier.problem.spec import read_spec
from falsifier.problem.starter import starter_spec

if TYPE_CHECKING:
    from pydantic import BaseModel
    from rich.console import Console
    from rich.table import Table

# Maximum rows of a table: models may have thousands of parameters or states.
_SHOWN_VARIABLES = 60
# Simulated time in s for info --check if the FMU states no stop time.
_CHECKED_SECONDS = 10.0
_NO_INTERFACE = "no interface that can be simulated (scheduled execution is not supported)"
# Text width if the output is not a terminal.
_PIPED_WIDTH = 160


@click.command()
@click.argument("fmu", type=click.Path(path_type=Path))
@click.option("--all", "everything", is_flag=True, help="Show all variables, including internal ones.")
@click.option(
    "--check",
    "checked",
    is_flag=True,
    help="Simulate with the step and with half of it, and show the largest differences of the outputs.",
)
@json_option
def info(*, fmu: Path, everything: bool, checked: bool, as_json: bool) -> None:
    """Show an FMU's interfaces, variables, units and ranges.

    FMU is an FMU, the name of a bundled one (AT), or a spec file, which stands for its FMU.
    """
    from falsifier.fmu import read_info

    source = _existing_fmu(fmu.parent / read_spec(fmu).model.fmu if fmu.suffix == ".toml" else fmu)
    found = read_info(source)
    if as_json:
        say(json.dumps(asdict(found), indent=2))
        return
    _print_info(found, everything=everything)
    if checked:
        _print_convergence(source, found)


@click.command()
@click.argument("fmu", type=click.Path(path_type=Path))
@out_option("FMU to write; default: NAME-PLATFORM.fmu in the same directory.")
def build(*, fmu: Path, out: Path | None) -> None:
    """Compile an FMU's C sources for this platform and write a copy of the FMU with the binary."""
    from falsifier.fmu.build import build as compile_sources

    written = compile_sources(_existing_fmu(fmu), out or fmu.with_name(f"{fmu.stem}-{sys.platform}.fmu"))
    say(f"{written} written")


@click.command()
@click.argument("fmu", type=click.Path(path_type=Path))
@out_option("Spec file to write; default: NAME.toml in the FMU's directory.")
@click.option("--force", is_flag=True, help="Replace an existing file.")
def init(*, fmu: Path, out: Path | None, force: bool) -> None:
    """Write a starter spec for an FMU: valid, and to be completed with ranges and requirements."""
    from falsifier.fmu import FmuModel, read_info

    source = _existing_fmu(fmu)
    path = out or fmu.with_suffix(".toml")
    if path.exists() and not force:
        raise SpecError(f"{path} already exists: choose another --out, or add --force to replace it")
    found = read_info(source)
    # Raises an error if the FMU cannot be simulated, before a useless spec is written.
    FmuModel(source, interface=default_interface(found) or "co-simulation")
    path.write_text(starter_spec(_relative(source, path), found), encoding="utf-8")
    load_problems(str(path))
    command = f"falsifier run {shlex.quote(str(path))}"
    say(f"{path} written. Enter the actual ranges and the requirement, then: {command}")


@click.command()
@click.argument("target")
@profile_option
def check(*, target: str, profile: str | None) -> None:
    """Check the keys, signals, ranges and formulas of a spec file without simulating."""
    for problem in load_problems(target, profile=profile):
        say(_problem_line(problem))


@click.command()
@click.option(
    "--of",
    "what",
    type=click.Choice(["spec", "manifest", "journal", "campaign"]),
    default="spec",
    show_default=True,
    help="What to describe: spec files, or a file in run directories (journal: one line of it).",
)
def schema(*, what: str) -> None:
    """Print the JSON Schema of spec files, for editors, or of the records in run directories."""
    say(json.dumps(_schema(what), indent=2))


def _schema(what: str) -> dict[str, Any]:
    from falsifier.campaigns.directory import CampaignRecord
    from falsifier.problem.spec import Spec
    from falsifier.search.manifest import Manifest
    from falsifier.search.records import RECORDS

    models: dict[str, type[BaseModel]] = {"spec": Spec, "manifest": Manifest, "campaign": CampaignRecord}
    return RECORDS.json_schema() if what == "journal" else models[what].model_json_schema()


def _print_convergence(fmu: Path, found: ModelInfo) -> None:
    """Print how much halving the step changes the outputs while each bounded input goes up and down once."""
    from falsifier.fmu import FmuModel
    from falsifier.fmu.step_check import step_convergence

    interface = default_interface(found)
    if interface is None:
        raise SpecError(f"{fmu}: {_NO_INTERFACE}; export the model for co-simulation or model exchange")
    stop_time = found.stop_time or _CHECKED_SECONDS
    outputs = tuple(v.name for v in found.outputs if v.kind != "string")
    experiment = Experiment(stop_time, default_interval(found, stop_time), outputs)
    signals = {
        v.name: Signal.evenly([v.low, v.high, v.low], stop_time=stop_time, interpolation="linear")
        for v in found.inputs
        if v.kind == "real" and v.low is not None and v.high is not None
    }
    model = FmuModel(fmu, interface=interface)
    try:
        movements = step_convergence(model, experiment, signals)
    finally:
        model.close()
    say(f"\n{interface}: step {experiment.output_interval:g} s compared with half of it over {stop_time:g} s")
    for name, moved in movements.items():
        unit = f" {found[name].unit}" if found[name].unit else ""
        say(
            f"  {name} changes by at most {moved.largest:.3g}{unit}, at {moved.time:.4g} s "
            f"({100 * moved.relative:.2f} % of its range)"
        )


def _existing_fmu(fmu: Path) -> Path:
    if fmu.is_file():
        return fmu
    inside = bundled("fmus") / f"{fmu.name.removesuffix('.fmu')}.fmu"
    if fmu.parent == Path() and inside.is_file():
        return inside
    raise SpecError(f"{fmu}: no such file; expected the path of an FMU, or the name of a bundled one")


def _relative(fmu: Path, spec: Path) -> Path:
    """Path of the FMU relative to the spec's directory (Path.relative_to has walk_up only in Python 3.12)."""
    return Path(relpath(fmu.resolve(), spec.resolve().parent))


def _problem_line(problem: Problem) -> str:
    space = problem.space
    searched = [
        f"{r.name} [{r.low:g}, {r.high:g}] ({counted(r.control_points, 'control point')}, {r.interpolation})"
        for r in space.inputs
    ]
    searched += [f"{p.name} [{p.low:g}, {p.high:g}]" for p in space.parameters]
    return f"{problem.name}: ok, {problem.requirement.formula}; searches {', '.join(searched)}"


def _print_info(found: ModelInfo, *, everything: bool) -> None:
    from rich.console import Console

    console = Console(highlight=False, width=None if sys.stdout.isatty() else _PIPED_WIDTH)
    # Captured and printed by click: if a pipe is closed, rich would exit with code 1, which means falsified.
    with console.capture() as text:
        _describe(console, found, everything=everything)
    click.echo(text.get(), nl=False)


def _describe(console: "Console", found: ModelInfo, *, everything: bool) -> None:
    console.print(
        f"[bold]{_shown(found.name)}[/bold]  FMI {_shown(found.fmi_version)}, "
        f"{', '.join(found.interfaces) or _NO_INTERFACE}"
    )
    if found.clocks:
        console.print(
            f"cannot be simulated: its input clocks ({_shown(', '.join(found.clocks))}) need external ticks, "
            "which are not supported; export the model without input clocks"
        )
    if found.description:
        console.print(_shown(found.description))
    platforms = ", ".join(found.platforms) or "none"
    console.print(f"platforms: {_shown(platforms)}; generated by {_shown(found.tool or 'an unknown tool')}")
    experiment = (
        f"{label} {value:g}{unit}"
        for label, value, unit in (
            ("stop time", found.stop_time, " s"),
            ("step", found.step_size, " s"),
            ("tolerance", found.tolerance, ""),
        )
        if value is not None
    )
    console.print(f"default experiment: {', '.join(experiment) or 'none'}", markup=False)
    groups = {
        "inputs": found.inputs,
        "outputs": found.outputs,
        "parameters": found.parameters,
        "states": tuple(v for v in found.variables if v.is_state),
    }
    if everything:
        shown = {v.name for group in groups.values() for v in group}
        groups["other variables"] = tuple(v for v in found.variables if v.name not in shown)
    for title, variables in groups.items():
        if variables:
            limit = len(variables) if everything else _SHOWN_VARIABLES
            console.print(_table(title, variables[:limit]))
            if len(variables) > limit:
                console.print(f"... and {len(variables) - limit} more; --all shows all {title}")


def _table(title: str, variables: tuple[Variable, ...]) -> "Table":
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for column in ("name", "type", "unit", "min", "max", "start", "description"):
        table.add_column(column, justify="right" if column in ("min", "max", "start") else "left")
    for v in variables:
        unit = f"{v.unit} (displayed in {v.display_unit})" if v.display_unit else v.unit
        cells = (v.name, v.kind, unit, _cell(v.low), _cell(v.high), _cell(v.start), v.description)
        table.add_row(*map(_shown, cells))
    return table


def _shown(text: str) -> str:
    """Return a text from an FMU so that rich prints it as it is, without control characters."""
    from rich.markup import escape

    return escape(one_line(text))


def _cell(value: float | str | None) -> str:
    return "" if value is None else f"{value:g}" if isinstance(value, int | float) else value
