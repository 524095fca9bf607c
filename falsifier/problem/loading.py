"""From spec files and their FMUs to problems.

``load_problem("AT1")`` loads a bundled one, ``load_problem("my.toml:REQ")`` one of a spec file::

    problem = load_problem("specs/AT.toml:AT1", profile="instance2")
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from falsifier.core.model import Experiment, Interface, ModelInfo, Variable
from falsifier.core.space import InputRange, ParameterRange, SearchSpace
from falsifier.errors import FormulaError, ModelError, SpecError, did_you_mean
from falsifier.problem.problem import Problem, Requirement
from falsifier.problem.ranges import fixed_value, input_range, parameter_range
from falsifier.problem.spec import (
    InputSection,
    ModelChanges,
    ParameterSection,
    Spec,
    overlay,
    read_spec,
)
from falsifier.stl import Formula, Monitor, parse

# Share of the output interval by which the stop time may miss a whole multiple of it: 15 / (1/30) is exact
# only up to rounding.
_GRID_ROUNDING = 1e-6
_DEFAULT_TIME_LIMIT = 60.0


def bundled(folder: str) -> Path:
    """Folder ``specs`` or ``fmus`` that came with the package: inside it, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / folder
    return inside if inside.is_dir() else package.parent / folder


def find_spec(target: str) -> tuple[Path, str | None]:
    """Spec file and requirement name that a target means.

    Args:
        target: ``file.toml``, ``file.toml:REQ``, or something bundled: ``AT``, ``AT:AT1``, ``AT1``.

    Raises:
        SpecError: when nothing of that name exists, with what there is.
    """
    path_part, _, requirement = target.rpartition(":") if ".toml:" in target else (target, "", "")
    if path_part.endswith(".toml"):
        return Path(path_part), requirement or None
    name, _, requirement = target.partition(":")
    names: list[str] = []
    for path in sorted(bundled("specs").glob("*.toml")):
        if path.stem == "published":
            continue
        if path.stem == name:
            spec = read_spec(path)
            only = next(iter(spec.requirements)) if len(spec.requirements) == 1 else None
            return path, requirement or only
        names.append(path.stem)
    for path in (bundled("specs") / f"{stem}.toml" for stem in tuple(names)):
        requirements = read_spec(path).requirements
        if name in requirements:
            return path, name
        names.extend(requirements)
    raise SpecError(
        f"no spec file or bundled requirement {target!r}; give a file like my.toml:REQ, or a bundled name: "
        f"{did_you_mean(name, names)}"
    )


def load_problem(
    target: str,
    *,
    profile: str | None = None,
    stl: str | None = None,
    changes: ModelChanges | None = None,
) -> Problem:
    """Load one problem.

    Args:
        target: see find_spec; the requirement may be left out where the spec has only one, or with stl.
        profile: name of a profile of the spec, e.g. ``instance2``.
        stl: a formula to judge instead of the spec's requirement.
        changes: what goes before everything that the spec says of the experiment, inputs and parameters.

    Raises:
        SpecError: naming file, key and cure.
        ModelError: when the FMU cannot be read.
    """
    path, requirement = find_spec(target)
    spec = read_spec(path)
    if requirement is None and path.stem in spec.requirements:
        requirement = path.stem  # NN is a spec and one of its requirements
    if requirement is None:
        if len(spec.requirements) > 1:
            raise SpecError(
                f"has {len(spec.requirements)} requirements, name one of them like "
                f"{path}:{next(iter(spec.requirements))}; known: {', '.join(spec.requirements)}",
                file=str(path),
            )
        requirement = next(iter(spec.requirements))
    return build_problem(spec, requirement, path=path, profile=profile, stl=stl, changes=changes)


def load_problems(target: str, *, profile: str | None = None) -> list[Problem]:
    """Load all requirements of a spec as problems, or the one that the target names."""
    path, requirement = find_spec(target)
    spec = read_spec(path)
    names = list(spec.requirements) if requirement is None else [requirement]
    return [build_problem(spec, name, path=path, profile=profile) for name in names]


def build_problem(
    spec: Spec,
    requirement: str,
    *,
    path: Path,
    profile: str | None = None,
    stl: str | None = None,
    changes: ModelChanges | None = None,
) -> Problem:
    """Join a validated spec with its FMU; path is the spec file, for relative names and for errors."""
    from falsifier.fmu import FmuModel, read_info

    file = str(path)
    if requirement not in spec.requirements:
        raise SpecError(
            f"no requirement {requirement!r}; {did_you_mean(requirement, spec.requirements)}", file=file
        )
    if profile is not None and profile not in spec.profiles:
        raise SpecError(f"no profile {profile!r}; {did_you_mean(profile, spec.profiles)}", file=file)
    fmu = path.parent / spec.model.fmu
    if not fmu.is_file():
        raise SpecError(
            f"there is no FMU {fmu}; give its path relative to the spec file", file=file, key="model.fmu"
        )
    layers = [*spec.changes(requirement, profile), *([changes] if changes else [])]
    model = FmuModel(fmu, interface=_interface(spec, layers, read_info(fmu), file))
    experiment = _experiment(spec, layers, model.info, file)
    inputs, parameters = _merged(spec, layers)
    space, fixed = _space(inputs, parameters, model.info, experiment, file)
    section = spec.requirements[requirement]
    is_option = stl is not None or path.suffix == ".fmu"
    key = "--stl" if is_option else f"requirements.{requirement}.formula"
    formula = parse_requirement(
        section.formula if stl is None else stl, model.info, experiment, file=file, key=key
    )
    return Problem(
        model,
        Requirement(requirement if stl is None else "stl", formula, "" if stl else section.description),
        space,
        _recording(experiment, model.info, [*spec.model.record, *formula.signals], file),
        fixed,
        source=f"{path}:{requirement}",
    )


def parse_requirement(
    text: str, info: ModelInfo, experiment: Experiment, *, file: str | None = None, key: str | None = None
) -> Formula:
    """Parse a formula and check its signals and windows against a model and an experiment.

    Raises:
        SpecError: naming file and key, with the parser's position, the unknown signal or the window that
            reaches past the stop time.
    """
    try:
        formula = parse(text)
        for name in formula.signals:
            if name not in info:
                known = [v.name for v in (*info.outputs, *info.inputs)]
                raise FormulaError(f"unknown signal {name!r}; {did_you_mean(name, known)}")
        Monitor(formula, step=experiment.output_interval, samples=experiment.samples)
    except FormulaError as error:
        raise SpecError(str(error), file=file, key=key) from None
    return formula


def _interface(spec: Spec, layers: Sequence[ModelChanges], info: ModelInfo, file: str) -> Interface:
    stated = next((layer.interface for layer in reversed(layers) if layer.interface), spec.model.interface)
    if not info.interfaces:
        raise ModelError(
            f"{info.name}: it offers neither co-simulation nor model exchange, and scheduled execution is "
            "not supported; export it for co-simulation"
        )
    if stated is None and len(info.interfaces) == 1:
        return info.interfaces[0]
    offered = " and ".join(info.interfaces)
    if stated is None or stated not in info.interfaces:
        raise SpecError(f"the FMU offers {offered}: say which", file=file, key="model.interface")
    return stated


def _experiment(spec: Spec, layers: Iterable[ModelChanges], info: ModelInfo, file: str) -> Experiment:
    def stated(key: str) -> float | None:
        value: float | None = getattr(spec.model, key)
        for layer in layers:
            if getattr(layer, key) is not None:
                value = getattr(layer, key)
        return value

    stop_time = stated("stop_time") or info.stop_time
    if stop_time is None:
        raise SpecError("the FMU has no default stop time: add this key", file=file, key="model.stop_time")
    output_interval = stated("output_interval") or info.step_size
    if output_interval is None:
        raise SpecError("the FMU has no default step: add this key", file=file, key="model.output_interval")
    intervals = stop_time / output_interval
    if round(intervals) < 1 or abs(intervals - round(intervals)) > _GRID_ROUNDING:
        raise SpecError(
            f"{output_interval:g} s does not divide the stop time {stop_time:g} s into whole intervals",
            file=file,
            key="model.output_interval",
        )
    return Experiment(
        stop_time=stop_time,
        output_interval=stop_time / round(intervals),
        outputs=(),
        step_size=stated("step_size"),
        tolerance=stated("tolerance"),
        time_limit=spec.model.time_limit or _DEFAULT_TIME_LIMIT,
    )


def _recording(experiment: Experiment, info: ModelInfo, extra: Iterable[str], file: str) -> Experiment:
    """Return the experiment that records all outputs and those extra variables that are no inputs."""
    inputs = {v.name for v in info.inputs}
    outputs = [v.name for v in info.outputs if v.kind != "string"]
    for name in extra:
        if name not in info:
            known = [v.name for v in info.variables]
            raise SpecError(
                f"unknown variable {name!r}; {did_you_mean(name, known)}", file=file, key="model.record"
            )
        if name not in outputs and name not in inputs:
            outputs.append(name)
    return replace(experiment, outputs=tuple(outputs))


def _merged(
    spec: Spec, layers: Iterable[ModelChanges]
) -> tuple[dict[str, InputSection], dict[str, ParameterSection]]:
    inputs, parameters = dict(spec.inputs), dict(spec.parameters)
    for layer in layers:
        for name, changed in layer.inputs.items():
            inputs[name] = overlay(inputs.get(name), changed)
        for name, change in layer.parameters.items():
            parameters[name] = overlay(parameters.get(name), change)
    return inputs, parameters


def _space(
    inputs: Mapping[str, InputSection],
    parameters: Mapping[str, ParameterSection],
    info: ModelInfo,
    experiment: Experiment,
    file: str,
) -> tuple[SearchSpace, dict[str, float]]:
    searched: list[InputRange] = []
    fixed: dict[str, float] = {}
    for name, section in inputs.items():
        key = f"inputs.{name}"
        variable = _variable(name, info.inputs, "input", file, key)
        if section.value is not None:
            fixed[name] = fixed_value(variable, section.value, file=file, key=f"{key}.value")
        else:
            searched.append(input_range(variable, section, file=file, key=key))
    ranges: list[ParameterRange] = []
    for name, parameter in parameters.items():
        key = f"parameters.{name}"
        settable = [v for v in info.variables if v.settable and v.causality != "input"]
        if name in info and not info[name].settable:
            v = info[name]
            raise SpecError(
                f"cannot be set: it is a {v.variability} {v.causality} of the FMU", file=file, key=key
            )
        variable = _variable(name, settable, "parameter or start value", file, key)
        if parameter.range is not None:
            ranges.append(parameter_range(variable, parameter.range, file=file, key=f"{key}.range"))
        elif parameter.value is not None:
            fixed[name] = fixed_value(variable, parameter.value, file=file, key=f"{key}.value")
    if not searched and not ranges:
        raise SpecError(
            "nothing to search: add [inputs.NAME] with range and control_points, "
            "or [parameters.NAME] with range",
            file=file,
            key="inputs",
        )
    return SearchSpace(tuple(searched), tuple(ranges), experiment.stop_time), fixed


def _variable(name: str, variables: Iterable[Variable], kind: str, file: str, key: str) -> Variable:
    known = {v.name: v for v in variables}
    if name not in known:
        raise SpecError(f"the FMU has no such {kind}; {did_you_mean(name, known)}", file=file, key=key)
    return known[name]
