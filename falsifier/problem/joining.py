"""Joining a validated spec with its FMU: checks names and ranges, and completes defaults from the FMU."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from falsifier.core.experiment import GRID_ROUNDING, Experiment, whole_steps
from falsifier.core.files import absent
from falsifier.core.literals import number_in
from falsifier.core.model import Model, ModelInfo
from falsifier.core.space import SearchSpace
from falsifier.core.words import listed, readable
from falsifier.errors import SpecError, did_you_mean, in_section, naming, setting, written
from falsifier.fmu import Rights, System, is_package, is_solved, read_info, read_package, resolved
from falsifier.problem.grid import Grid, check_steps, choose_grid, default_freedom, formula_times
from falsifier.problem.models import make_model
from falsifier.problem.ranges import search_space, string_values, value_kind
from falsifier.problem.requirement import Requirement, check_comparable, formula_of, section_formulas
from falsifier.problem.sections import InputSection, ModelChanges, ParameterSection, Simulation
from falsifier.problem.shorthand import searching, stated_as
from falsifier.problem.source import STL_NAME
from falsifier.problem.spec import AnyRequirement, Spec, overlay, parse_spec
from falsifier.problem.unit_check import defined_units, factor_and_offset
from falsifier.stl import Formula

# Maximum number of states or locals that are recorded if the FMU declares no outputs.
_MAX_RECORDED = 50


class Joined(NamedTuple):
    """Parts of a problem; the attributes are those of Problem."""

    model: Model
    requirement: Requirement
    space: SearchSpace
    experiment: Experiment
    parameters: Mapping[str, float]
    notes: tuple[str, ...]


def join(
    spec: Spec,
    requirement: str,
    *,
    path: Path,
    profile: str | None = None,
    stated: AnyRequirement | None = None,
    stated_name: str = STL_NAME,
    changes: ModelChanges | None = None,
    model: Model | None = None,
    searches: bool = True,
    is_free: bool = True,
) -> Joined:
    """Join a validated spec with its FMU or system.

    ``path`` is that of the spec file, for relative paths and error messages. ``stated`` is the requirement of
    an option, to use instead of the spec's with what that one overrides. ``changes`` are stronger than
    everything in the spec. Without a model, it is the one that the spec names. ``searches``: whether to
    refuse a spec in which everything is fixed. ``is_free``: whether the spec's limits of free control points
    hold where it also states a number of them.

    Raises:
        SpecError: naming the file, the key and the remedy.
        ModelError: if the FMU cannot be read or simulated.
    """
    stating: dict[str, Spec | ModelChanges] = {"": spec}
    with in_section(str(path)), _where_stated(stating):
        if requirement not in spec.requirements:
            raise SpecError(f"no requirement {requirement!r}; {did_you_mean(requirement, spec.requirements)}")
        if profile is not None and profile not in spec.profiles:
            near = did_you_mean(profile, spec.profiles)
            raise SpecError(f"no profile {profile!r}; {near}; without a profile: free or fixed")
        overriding, changes = spec.changes(requirement, profile), changes or ModelChanges()
        stating |= overriding
        allowing: dict[str, Simulation] = {"model": spec.model, **overriding}
        for place, each in allowing.items():
            with in_section(key=place):
                Rights.of(resolved(each.allow, path.parent), each.deny)
        layers = list(overriding.values())
        model = model or make_model(spec, [*layers, changes], path)
        info = model.info
        layers.append(changes := placed(changes, info))
        # All formulas of a spec, so that its requirements can share a search.
        sections = list(spec.requirements.values()) if stated is None else [stated]
        if any(layer.stop_time for layer in layers[1:]):  # goes before what requirements state
            sections = [each.model_copy(update={"stop_time": None}) for each in sections]
        formulas_of = partial(section_formulas, sections)
        experiment, grid = _experiment(spec, layers, info, changes, formulas_of)
        if isinstance(model, System):
            model.check_steps(experiment)
        inputs, parameters = dict(spec.inputs), dict(spec.parameters)
        for layer in layers:
            inputs |= {name: overlay(inputs.get(name), s) for name, s in layer.inputs.items()}
            parameters |= {name: overlay(parameters.get(name), s) for name, s in layer.parameters.items()}
        if not is_free:
            no = {"free": None}
            inputs = {n: s.model_copy(update=no) if s.control_points else s for n, s in inputs.items()}
        formulas = formulas_of(experiment.stop_time)
        free = default_freedom(formulas, stop_time=experiment.stop_time, step=experiment.output_interval)
        inputs = {name: s.model_copy(update={"free": free}) if s.is_open else s for name, s in inputs.items()}
        space, fixed = search_space(inputs, parameters, info, experiment.stop_time, changes)
        if searches and not space.names:
            raise _nothing_to_search(info, changes, inputs)
        for r in space.inputs:
            check_steps(experiment.stop_time, r.hold, key=f"inputs.{r.name}.hold")
        section, name, key = spec.requirements[requirement], requirement, f"requirements.{requirement}"
        if stated is not None:
            section, name, key = stated, stated_name, ""
        formula = formula_of(section, info, experiment, key=key)
        known = {*space.names, *fixed, *(v.name for v in info.inputs if v.start_number is not None)}
        experiment = replace(experiment, strings=string_values(parameters, info, path.parent))
        omitted = dict.fromkeys(spec.model.omit, "model.omit") | dict.fromkeys(changes.omit, setting("omit"))
        omitted |= {name: f"{place}.omit" for place, each in overriding.items() for name in each.omit}
        return Joined(
            model,
            Requirement(name, formula, section.description),
            space,
            _recording(experiment, info, [*spec.model.record, *formula.signals], known, omitted),
            fixed,
            (*info.notes, *_notes(grid, model, space, fixed, experiment)),
        )


@contextmanager
def _where_stated(layers: Mapping[str, Spec | ModelChanges]) -> Iterator[None]:
    """Let errors raised within name the last section, of those by their keys, that states what is wrong."""
    try:
        yield
    except SpecError as error:
        stated: dict[str, str] = {}
        for place, section in layers.items():
            begin = place and f"{place}."
            stated |= {f"model.{key}": f"{begin}{key}" for key in section.model_fields_set if place}
            for kind, found in (("inputs", section.inputs), ("parameters", section.parameters)):
                for name, each in found.items():
                    keys = (f"{kind}.{name}", *(f"{kind}.{name}.{key}" for key in each.model_fields_set))
                    stated |= {key: f"{begin}{key}" for key in keys}
        wrong = error.key or ""
        near = max((key for key in stated if f"{wrong}.".startswith(f"{key}.")), key=len, default=None)
        if error.file is not None or near is None:
            raise
        raise SpecError(error.message, key=stated[near] + wrong.removeprefix(near)) from None


def join_formula(
    model: Path | System,
    stated: AnyRequirement,
    *,
    changes: ModelChanges,
    name: str = STL_NAME,
    searches: bool = True,
) -> Joined:
    """Join an FMU, SSP package or system with a requirement, without a spec.

    If no input or parameter is to be searched, all inputs with a min and a max are searched, and those whose
    type states them (Booleans, enumerations). There must be one, unless the problem is not for a search.

    Raises:
        SpecError: naming what is unknown and the option that specifies it.
        ModelError: if the FMU cannot be read.
    """
    path = model if isinstance(model, Path) else Path(model.name)
    if isinstance(model, Path) and not model.is_file():
        raise SpecError(f"{absent(path)}; give the path of an FMU or SSP package")
    if isinstance(model, Path) and is_package(model):
        model = replace(read_package(model), logging=bool(changes.logging))
    data: dict[str, Any]
    if isinstance(model, Path):
        info, system = read_info(model), None
        interface = changes.interface or info.default_interface
        data = {"model": {"fmu": str(model.resolve()), "interface": interface}}
    else:
        if changes.interface == "model-exchange":
            raise SpecError(f"{setting('interface')}: components of a system have interfaces of their own")
        info = model.info
        system = replace(model, allow=(*model.allow, *changes.allow), deny=(*model.deny, *changes.deny))
        data = {"model": {}, "components": {n: {"fmu": str(part.fmu)} for n, part in model.parts.items()}}
    changes = placed(changes, info)
    data["model"]["stop_time"] = changes.stop_time or info.stop_time
    if data["model"]["stop_time"] is None:
        stop_time = setting("stop_time", "SECONDS")
        raise SpecError(f"{path}: the {info.noun} has no default stop time; add {stop_time}")
    spec = parse_spec(data | {"requirements": {STL_NAME: stated}}, file=str(path))
    if all(section.value is not None for _, section in changes.variables):
        bounded = {v.name: InputSection() for v in info.inputs if v.is_bounded}
        changes = changes.model_copy(update={"inputs": bounded | changes.inputs})
    return join(
        spec,
        STL_NAME,
        path=path,
        stated=stated,
        stated_name=name,
        changes=changes,
        model=system,
        searches=searches,
    )


def _experiment(
    spec: Spec,
    layers: Sequence[ModelChanges],
    info: ModelInfo,
    changes: ModelChanges,
    formulas_of: Callable[[float], Iterable[Formula]],
) -> tuple[Experiment, Grid | None]:
    """Return the experiment without outputs, and its grid if nobody stated the interval.

    ``formulas_of`` gives the formulas for a stop time.
    """

    def stated(key: str) -> float | None:
        each = (getattr(section, key) for section in (*reversed(layers), spec.model))
        return next((value for value in each if value is not None), None)

    stop_time = stated("stop_time") or info.stop_time or 0.0
    if not stop_time:
        raise SpecError(f"the {info.noun} has no default stop time; add this key", key="model.stop_time")
    output_interval, step_size, grid = stated("output_interval"), stated("step_size"), None
    changed = [k for k in ("output_interval", "step_size", "stop_time") if getattr(changes, k) is not None]
    with naming(setting("stop_time") if changes.stop_time is not None else None):
        check_steps(stop_time, stop_time, key="model.stop_time")
    with naming(setting(changed[0]) if changed else None):
        if output_interval is None:
            times = formula_times(formulas_of(stop_time))
            steps = {"fmu_step": info.step_size, "internal_step": info.internal_step}
            grid = choose_grid(stop_time, times=times, **steps, step_size=step_size)
            output_interval = grid.interval
        check_steps(stop_time, output_interval, key="model.output_interval")
        check_steps(stop_time, step_size, key="model.step_size")
        with in_section(key="model"):
            intervals = whole_steps("stop_time", stop_time, "output_interval", output_interval)
            experiment = Experiment(
                stop_time=stop_time,
                output_interval=stop_time / intervals,
                outputs=(),
                step_size=step_size,
                tolerance=stated("tolerance"),
                time_limit=stated("time_limit"),
            )
    return experiment, grid


def _notes(
    grid: Grid | None, model: Model, space: SearchSpace, fixed: Mapping[str, float], experiment: Experiment
) -> Iterator[str]:
    if grid is not None:
        yield f"time grid of {grid.interval:g} s: {grid.reason}"
    step = experiment.step
    for r in space.inputs if not is_solved(model) else ():
        times = space.fixed_times(r)[:2]
        if r.hold is not None and r.hold < step:
            yield f"{r.name}: hold = {readable(r.hold)} s is shorter than the communication step, {step:g} s"
        elif r.free is None and len(times) > 1 and times[1] < step * (1.0 - GRID_ROUNDING):
            yield (
                f"{r.name}: control points {readable(times[1])} s apart are closer than the communication "
                f"step, {step:g} s, at which the model is given inputs"
            )
    limits = {r.name: (r.low, r.high) for r in space.ranges}
    yield from unit_notes(model, limits | {name: (value, value) for name, value in fixed.items()})
    yield from rights_notes(model)


def unit_notes(model: Model, limits: Mapping[str, tuple[float, float]]) -> Iterator[str]:
    """Say which ranges, or values as ranges with equal ends, seem to be in the unit that the FMU displays."""
    for name, (low, high) in limits.items():
        variable = model.info[name]
        start, unit, shown = variable.start_number, variable.unit, variable.display_unit
        if start is None or not unit or shown in ("", unit):
            continue
        if low < high:
            is_strange = not low <= start <= high
            what = f"its start value, {readable(start)} {unit}, is outside the range"
        else:
            units, is_relative = defined_units(model), variable.is_relative
            factor, offset = factor_and_offset(shown, unit, units, is_relative=is_relative) or (1.0, 0.0)
            is_strange = abs(factor * low + offset - start) < abs(low - start)
            what = f"{readable(low)} {shown} would be nearer to its start value, {readable(start)} {unit}"
        if is_strange:
            how = f"all numbers are in {unit}, not in {shown}, in which the FMU wants it displayed"
            yield f"{name}: {what}; {how}"


def rights_notes(model: Model) -> Iterator[str]:
    """Say what a spec, an option or a counterexample lets the FMU do, which the user may not have written."""
    for name, said in (("allow", "may also"), ("deny", "may not use")):
        if words := getattr(model, name, ()):
            yield f"the {model.info.noun} {said}: {', '.join(words)}"


def _recording(
    experiment: Experiment,
    info: ModelInfo,
    extra: Iterable[str],
    known: Collection[str],
    omitted: Mapping[str, str],
) -> Experiment:
    """Return the experiment that records all outputs and those extra variables whose values are unknown.

    Omitted variables, with the key that omits them, are recorded only if they are extra ones, too.
    """
    outputs = [v.name for v in info.outputs if v.kind != "string"]
    if not outputs and len(info.observables) <= _MAX_RECORDED:
        outputs = [v.name for v in info.observables if v.kind != "string"]
    internals = [v.name for v in info.internals if v.name not in outputs]
    if unknown := next((name for name in omitted if name not in (*outputs, *internals)), None):
        near = did_you_mean(unknown, [*outputs, *internals])
        raise SpecError(f"no output {unknown!r}; {near}", key=omitted[unknown])
    outputs = [name for name in outputs if name not in omitted]
    for name in extra:
        if name not in info:
            names = [v.name for v in info.variables]
            raise SpecError(f"unknown variable {name!r}; {did_you_mean(name, names)}", key="model.record")
        with in_section(key="model.record"):
            check_comparable(info[name])
        if name not in outputs and not (info[name].causality == "input" and name in known):
            outputs.append(name)
    internals = [name for name in internals if name not in (*omitted, *outputs)]
    return replace(experiment, outputs=tuple(outputs), internals=tuple(internals))


def _nothing_to_search(info: ModelInfo, changes: ModelChanges, inputs: Collection[str]) -> SpecError:
    """Return the error that says what keeps everything constant, and what lets something vary.

    ``inputs`` are those with a section, in which all of them have values.
    """
    kept = [name for name, _ in changes.variables]
    bounded = [v.name for v in info.inputs if v.is_bounded]
    known, kind, add = list(info.inputs), "inputs", searching("inputs", "NAME")
    why, section = "no input has a range", "[inputs.NAME] with range and control_points, or "
    if not known:
        known = [v for v in info.variables if v.settable and v.kind != "string"]
        known.sort(key=lambda v: v.causality != "parameter")
        kind, add = "parameters and start values", searching("parameters", "NAME")
        why, section = f"the {info.noun} has no input", ""
    if inputs and not kept:
        why = f"the spec keeps {listed([*inputs])} constant"
    elif kept:
        why = f"{written('--set keeps', 'a value keeps')} {listed(kept)} constant"
    elif bounded:
        why = f"{listed(bounded)} would be searched between min and max if a section [inputs.NAME] named them"
    return SpecError(
        f"nothing to search: {why}, and nothing else varies; add {add}, or to a spec "
        f"{section}[parameters.NAME] with range; {kind} {did_you_mean('', (v.name for v in known))}"
    )


def placed(changes: ModelChanges, info: ModelInfo) -> ModelChanges:
    """Return the changes with each name where the model has it: options do not say what is an input.

    Raises:
        SpecError: if the model has no such name, or cannot do with it what is asked.
    """
    inputs, parameters = dict[str, InputSection](), dict[str, ParameterSection]()
    for name, section in changes.variables:
        kind = "inputs" if name in changes.inputs else "parameters"
        with naming(stated_as(kind, name, searched=section.value is None)):
            if name not in info:
                names = [v.name for v in info.variables if v.settable or v.causality == "input"]
                cut = next((n for n in names if n.startswith(f"{name}=")), "")
                near = f"write [inputs.NAME] or [parameters.NAME] with {cut!r} in a spec" if cut else ""
                raise SpecError(
                    f"the {info.noun} has no input, parameter or start value {name!r}; "
                    f"{near or did_you_mean(name, names)}"
                )
            stated, variable = section.model_dump(exclude_unset=True), info[name]
            if isinstance(text := section.value, str) and variable.kind != "string":
                number = number_in(text) if variable.number_of(text) is None else None
                stated["value"] = text if number is None else number
            if variable.causality == "input" and "scale" in stated:
                raise SpecError("is an input: only parameters can have a scale; leave it out")
            if variable.causality == "input":
                inputs[name] = InputSection.model_validate(stated)
            elif not stated.keys() <= {"range", "value", "scale"}:
                value_kind(variable)
                raise SpecError(f"is no input: {searching(kind, name)} searches it, without control points")
            else:
                parameters[name] = ParameterSection.model_validate(stated)
    return changes.model_copy(update={"inputs": inputs, "parameters": parameters})
