"""``falsifier info`` and ``falsifier init``: what an FMU holds, and a spec for it."""

from contextlib import closing
from dataclasses import asdict, replace
from itertools import chain, count
from math import isinf
from pathlib import Path
from typing import Any

import click

from falsifier.cli.command import command, refuse
from falsifier.cli.files import in_existing_folder
from falsifier.cli.options import PATH, changes_in, json_option, out_option, policy_options
from falsifier.cli.output import as_shown, say
from falsifier.context.simulink import read_diagram
from falsifier.context.values import SIMULINK
from falsifier.core.experiment import Experiment
from falsifier.core.files import absent, bundled, write_whole
from falsifier.core.literals import shell_word
from falsifier.core.model import ModelInfo
from falsifier.core.signals import Signal
from falsifier.core.words import in_unit
from falsifier.errors import MachineError, ModelError, SpecError, in_section
from falsifier.evaluation.confirm import step_convergence, sufficient_step
from falsifier.fmu import FmuModel, System, is_package, read_info, read_package, rights_text
from falsifier.problem.grid import choose_grid
from falsifier.problem.loading import find_spec
from falsifier.problem.models import existing_fmu, make_system, rights_of
from falsifier.problem.sections import ModelSection
from falsifier.problem.source import Target
from falsifier.problem.spec import read_spec
from falsifier.views.model_text import info_text, model_json, simulink_text

# Maximum number of variables that are compared if the FMU declares no outputs.
_CHECKED_VARIABLES = 50
# What halving the step may change in a system, as a share of an output's range, and how often it is halved.
_COUPLING_SHARE, _HALVINGS = 0.01, 6


@command()
@click.argument("fmu", metavar="FILE", type=PATH)
@click.option("--all", "everything", is_flag=True, help="Show all variables, including internal ones.")
@click.option(
    "--check",
    "checked",
    is_flag=True,
    help="Simulate at the step, or a spec's, and at half of it; show the largest differences of the outputs.",
)
@policy_options
@json_option
def info(*, fmu: Path, everything: bool, checked: bool, as_json: bool, **options: Any) -> None:
    """Show an FMU's interfaces, variables, units and ranges, or those of a system of FMUs.

    FILE is an FMU, the name of a bundled FMU (AT) or of a bundled requirement (AT1), or a spec file; for the
    last two, their FMU or system is shown. A Simulink file (.slx, .mdl) is shown as blocks, lines and charts.
    """
    if fmu.suffix.lower() in SIMULINK:
        refuse("applies to FMUs only", all=everything, check=checked)
        diagram = read_diagram(fmu)
        say(as_shown(simulink_text(diagram), as_json and asdict(diagram), as_json=as_json))
        return
    if as_json and (everything or checked):
        said = "JSON shows all variables anyway" if everything else "the comparison is printed as text only"
        refuse(f"{said}; drop one of them", all=everything, check=checked, json=True)
    source, changes = _named(fmu), changes_in(options)
    found = read_info(source) if isinstance(source, Path) else source.info
    spec = _spec_of(fmu)
    stated = read_spec(spec).model if spec else ModelSection()
    rights = rights_of(spec, [stated, changes])
    try:
        note = rights_text(*rights)
    except (MachineError, ModelError) as error:  # the description can be shown all the same
        note = f"FMUs cannot be simulated now: {error}"
    found = replace(found, notes=(*found.notes, note))
    say(as_shown(info_text(found, everything=everything), as_json and model_json(found), as_json=as_json))
    if checked:
        _print_convergence(source, found, stated, *rights)


@command()
@click.argument("fmus", metavar="FMU...", type=PATH, nargs=-1, required=True)
@out_option("Spec file to write; default: NAME.toml in the FMU's directory, or system.toml for several.")
def init(*, fmus: tuple[Path, ...], out: Path | None) -> None:
    """Write a starter spec, in which you fill in ranges and the requirement.

    FMU is an FMU or an SSP package. Several FMUs become the components of a system, to be connected in the
    spec.
    """
    from falsifier.problem.writing import problem_of_starter

    if spec := next((f for f in fmus if f.suffix == ".toml"), None):
        command = f"falsifier check {shell_word(spec)}"
        raise SpecError(f"{spec} is a spec, not an FMU; to check it: {command}")
    for nameless in (f for f in fmus if not f.name):  # "." and "/", beside which no spec can be named
        _existing_fmu(nameless)
    usual = fmus[0].with_suffix(".toml") if len(fmus) == 1 else fmus[0].with_name("system.toml")
    path = in_existing_folder(out or usual)
    if path.exists() or path.is_symlink():  # one that leads back to itself
        raise SpecError(f"{path} already exists: choose another --out, or delete it first")
    text = _starter(fmus, path)
    problem_of_starter(text, path)
    write_whole(path, text)
    command = f"falsifier run {shell_word(path)}"
    say(f"{path} written. Enter the actual ranges and the requirement, then: {command}")


def _starter(fmus: tuple[Path, ...], path: Path) -> str:
    from falsifier.problem.writing import seen_from, starter_spec

    if len(fmus) > 1:
        parts: dict[str, Path] = {}
        for source in map(one_fmu, fmus):
            names = chain([source.stem], (f"{source.stem}{i}" for i in count(2)))
            parts[next(name for name in names if name not in parts)] = source
        info = System(dict(parts), name=path.stem).info
        return starter_spec({name: seen_from(path, source) for name, source in parts.items()}, info)
    given = fmus[0]
    if is_package(given):
        return starter_spec(seen_from(path, given), read_package(given).info)
    source = one_fmu(given)
    found = read_info(source)
    # Raises an error if the FMU cannot be simulated, before a useless spec is written.
    FmuModel(source, interface=found.default_interface)
    return starter_spec(seen_from(path, source), found)


def _print_convergence(
    source: Path | System,
    found: ModelInfo,
    stated: ModelSection,
    allow: tuple[str, ...],
    deny: tuple[str, ...],
) -> None:
    """Print what halving the step, a spec's if it states one, changes while each input goes up and down."""
    from falsifier.problem.writing import DEFAULT_STOP_TIME

    interface = stated.interface or found.default_interface
    stop_time = stated.stop_time or found.stop_time or DEFAULT_STOP_TIME
    named = (v.name for v in found.observables if v.kind != "string" and v.name not in stated.omit)
    outputs = tuple(named)[:_CHECKED_VARIABLES]
    if not outputs:
        raise SpecError(f"{found.name}: no output, state or other computed variable to compare")
    interval, reason = stated.output_interval, "as the spec states"
    if interval is None:
        grid = choose_grid(
            stop_time, fmu_step=found.step_size, internal_step=found.internal_step, step_size=stated.step_size
        )
        interval, reason = grid.interval, grid.reason
    settings = (stated.step_size, stated.tolerance, stated.time_limit)
    experiment = Experiment(stop_time, interval, outputs, *settings)
    signals = {
        v.name: Signal.evenly([v.low, v.high, v.low], stop_time=stop_time, interpolation="linear")
        for v in found.inputs
        if v.kind == "real" and v.low is not None and v.high is not None
    }
    model: FmuModel | System
    if isinstance(source, Path):
        model = FmuModel(source, interface=interface, allow=allow, deny=deny)
    else:
        model = replace(source, allow=allow, deny=deny)
    with closing(model):
        movements = step_convergence(model, experiment, signals)
        advice = _step_advice(model, experiment, signals) if isinstance(model, System) else ""
    over = f"over {stop_time:.10g} s ({reason})"
    say(f"\n{interface}: step {experiment.step:g} s compared with half of it {over}:")
    if not found.outputs:
        say(f"  the {found.noun} declares no outputs; these are its states or other computed variables")
    for name, moved in movements.items():
        most = in_unit(f"{moved.largest:.3g}", found[name].unit)
        share = f"{100 * moved.relative:.2g} % of its range"
        share = "constant at half of the step" if isinf(moved.relative) else share
        say(f"  {name} changes by at most {most}, at {moved.time:.10g} s ({share})")
    if not any(moved.largest for moved in movements.values()):
        say("  if the model rests at its start values, this says nothing about the step")
    if advice:
        say(f"  {advice}")


def _step_advice(system: System, experiment: Experiment, signals: dict[str, Signal]) -> str:
    """Say which step keeps the error of the coupling small."""
    share = f"{100 * _COUPLING_SHARE:g} % of its range"
    step = sufficient_step(system, experiment, signals, share=_COUPLING_SHARE, halvings=_HALVINGS)
    if step is None:
        finest = experiment.step / 2**_HALVINGS
        return (
            f"no step down to {finest:g} s keeps every output within {share} when it is halved: the coupling "
            "is too coarse, or outputs jump at events"
        )
    kept = f"keeps every output within {share} when it is halved"
    if step == experiment.step:
        return f"this step {kept}"
    return f"step_size = {step:g} {kept}; set it in [model]"


def _named(given: Path) -> Path | System:
    """Return the FMU that is given, or the FMU or system of the spec or bundled name that is given."""
    if is_package(given):
        return read_package(given)
    path = _spec_of(given)
    if path is None:
        return _existing_fmu(given)
    spec = read_spec(path)
    with in_section(str(path)):
        return make_system(spec, path) if spec.is_system else existing_fmu(path, spec.model.fmu or "")


def _spec_of(given: Path) -> Path | None:
    """Return the spec that is given, or that of the bundled requirement whose name is; None for an FMU."""
    if (target := Target.parse(str(given))).kind == "spec":
        return Path(target.file)
    is_file = given.parent != Path() or given.suffix or given.is_file() or _bundled_fmu(given).is_file()
    return find_spec(str(given))[0] if target.kind == "python" or not is_file else None


def one_fmu(given: Path) -> Path:
    """Return the FMU that is given, by path or name; SpecError if there is none, or several."""
    found = _named(given)
    if isinstance(found, Path):
        return found
    raise SpecError(f"{given} is a system of FMUs; give one of them: {', '.join(found.parts)}")


def _existing_fmu(fmu: Path) -> Path:
    if fmu.is_file():
        return fmu
    if fmu.parent == Path() and _bundled_fmu(fmu).is_file():
        return _bundled_fmu(fmu)
    raise SpecError(f"{absent(fmu)}; expected the path of an FMU, or the name of a bundled one")


def _bundled_fmu(name: Path) -> Path:
    return bundled("fmus") / f"{name.name.removesuffix('.fmu')}.fmu"
