"""Writing specs: starters for an FMU, with comments on what to fill in, and requirements added to a spec."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, floor
from os.path import relpath
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import InlineTable, Item

from falsifier.core.arguments import utf_8
from falsifier.core.files import absent
from falsifier.core.literals import one_line, shortest, toml_key
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.words import in_unit
from falsifier.errors import FormulaError, SpecError
from falsifier.fmu import is_package, read_info, read_package, with_paths
from falsifier.fmu.description.structure import conversion
from falsifier.problem.grid import fitting_interval
from falsifier.problem.joining import join
from falsifier.problem.loading import find_spec
from falsifier.problem.problem import Problem
from falsifier.problem.ranges import DEFAULT_POINTS
from falsifier.problem.requirement import PLACEHOLDER, parse_requirement
from falsifier.problem.sections import RequirementSection
from falsifier.problem.shorthand import named_file
from falsifier.problem.source import MODEL_FILES
from falsifier.problem.spec import parse_spec, read_spec
from falsifier.stl import Formula, parse
from falsifier.stl.lexer import name_text

# Stop time in s if the FMU specifies none.
DEFAULT_STOP_TIME = 10.0
# Maximum number of parameters, of initial states, and of variables to write requirements about, listed.
_SHOWN_PARAMETERS = 10
_SHOWN_VARIABLES = 20
# Name of the requirement in a starter spec, which is to be replaced.
_STARTED = "R1"
# A requirement in place of one that is still to be written.
_ANY = "0 <= 1"


def starter_spec(fmu: Path | Mapping[str, Path], info: ModelInfo) -> str:
    """Return the text of a spec file: valid but for its requirement; comments say what to fill in.

    Args:
        fmu: path of an FMU or SSP package; or of the FMUs of a system without connections, by component.
        info: what is known about the FMU or the system.

    Raises:
        SpecError: if there is nothing to search, or nothing to write a requirement about.
    """
    inputs = [v for v in info.inputs if v.kind != "string"]
    settable = [v for v in info.variables if v.settable and v.kind != "string" and v.causality != "input"]
    settable = [v for v in settable if _varies(v)]
    # Parameters and initial states, or else all start values; real ones first.
    tunable = [v for v in settable if v.causality == "parameter" or v.is_state] or settable
    tunable.sort(key=lambda v: (v.causality != "parameter", v.kind != "real"))
    has_input = any(map(_varies, inputs))
    if not has_input and not tunable:
        raise SpecError(
            f"{info.name}: nothing to search: the {info.noun} has no input, parameter or start value to set "
            "to more than one value"
        )
    sections = [_comment(f"{info.name}: {info.description}" if info.description else info.name)]
    model = ["[model]"]
    if isinstance(fmu, Path):
        model += [f"fmu = {_toml(fmu.as_posix())}"]
        model += [f"interface = {_toml(info.default_interface)}"]
    else:
        sections += _components(fmu, info)
    stop_time = info.stop_time or DEFAULT_STOP_TIME
    doubt = "" if info.stop_time else f"the {info.noun} specifies none: check this"
    model += [_noted(f"stop_time = {_toml(stop_time)}", doubt)]
    model += ["# output_interval = SECONDS  # default: fits the FMU's step, the formulas and the stop time"]
    sections += ["\n".join(model), *map(_input, inputs)]
    if tunable:
        sections.append(_parameters(tunable, searched=() if has_input else tunable[:1]))
    sections.append(_requirement(info, stop_time))
    return "\n\n".join(sections) + "\n"


def seen_from(spec: Path, path: Path) -> Path:
    """Return a path relative to a spec's folder, as the spec states it; SpecError if it is not of UTF-8.

    Path.relative_to has walk_up only in Python 3.12.
    """
    return Path(utf_8(relpath(path.resolve(), spec.resolve().parent)))


def _components(fmus: Mapping[str, Path], info: ModelInfo) -> Iterator[str]:
    for name, path in fmus.items():
        yield (
            f"[components.{toml_key(name)}]\nfmu = {_toml(path.as_posix())}\n"
            "# step = SECONDS  # of its own; default: the communication step"
        )
    lines = ["INPUT = OUTPUT; an input that is connected needs no [inputs] section below:"]
    for v in info.inputs:
        component = max((n for n in fmus if v.name.startswith(f"{n}.")), key=len)
        others = [o for o in info.outputs if o.kind == v.kind and not o.name.startswith(f"{component}.")]
        # Units that only the FMUs define might be converted, too: these outputs come if there are no others.
        fitting = [o for o in others if conversion(o.unit, v.unit, ({}, {}))] or others
        near = [o for o in fitting if _local(o.name) == _local(v.name)] or fitting[:_SHOWN_VARIABLES]
        shown = " or ".join(f'"{o.name}"' for o in near)
        lines.append(f'"{v.name}" = {shown or "OUTPUT"}')
    yield "\n".join(["[connections]", *map(_comment, lines)])


def _local(name: str) -> str:
    return name.rpartition(".")[2]


def _input(v: Variable) -> str:
    unit = "" if v.unit == "1" else v.unit
    meaning = ", ".join(part for part in (v.description, unit and f"in {unit}") if part)
    lines = [f"[inputs.{toml_key(v.name)}]"]
    lines += [_comment(line) for line in (meaning, v.items_text) if line]
    low, high = v.limits
    # What the FMU leaves open is one unit away from what it states.
    if low is None:
        low = 0.0 if high is None else high - 1.0
    if high is None:
        high = low + 1.0
    if low == high:
        return "\n".join([*lines, f"value = {_toml(low)}"])
    doubt = "" if v.is_bounded else "unbounded: the FMU specifies no min and max; replace with the real range"
    lines.append(_noted(f"range = {_range(v, low, high)}", doubt))
    points = f"control_points = {DEFAULT_POINTS}  # evenly spaced; without this line engines choose them"
    return "\n".join([*lines, _comment(points)])


def _varies(v: Variable) -> bool:
    """Whether a variable may have more than one value."""
    low, high = v.limits
    return low is None or high is None or low < high


def _parameters(tunable: Sequence[Variable], *, searched: Sequence[Variable]) -> str:
    lines = ["[parameters]"]
    for v in searched:
        start = v.start_number or 0.0
        reach = max(abs(start), 1.0) / 2
        low, high = v.limits
        # The start value may be outside of what the FMU states.
        low = (start if high is None else min(start, high)) - reach if low is None else low
        high = max(start, low) + reach if high is None else high
        least, most = v.type_limits or (low, high)
        limits = _range(v, max(low, least), min(high, most))
        lines.append(_noted(f"{toml_key(v.name)}.range = {limits}", "replace with the real range"))
    others = [v for v in tunable if v not in searched]
    if others:
        lines.append(
            '# Each may be searched (over decades: add NAME.scale = "log"), or fixed with NAME = NUMBER:'
        )
    listed = others[:_SHOWN_PARAMETERS]
    listed += [v for v in others if v.is_state and v not in listed][:_SHOWN_PARAMETERS]
    for v in listed:
        low, high = v.limits
        shown = "[LOW, HIGH]" if low is None or high is None else _range(v, low, high)
        default = "not stated" if v.start_number is None else in_unit(shortest(v.start_number), v.unit)
        items = f" ({v.items_text})" if v.items_text else ""
        lines.append(_comment(f"{toml_key(v.name)}.range = {shown}  # default: {default}{items}"))
    if len(others) > len(listed):
        lines.append(_comment(f"... and {len(others) - len(listed)} more, which falsifier info lists"))
    return "\n".join(lines)


def _requirement(info: ModelInfo, stop_time: float) -> str:
    candidates = [v for v in info.observables if v.kind != "string"]
    if not candidates:
        raise SpecError(f"{info.name}: the FMU computes no variable that a requirement could be about")
    lines = [f"[requirements.{_STARTED}]"]
    if not info.outputs:
        shown = ", ".join(name_text(v.name) for v in candidates[:_SHOWN_VARIABLES])
        more = ", ..." if len(candidates) > _SHOWN_VARIABLES else ""
        lines.append(_comment(f"The FMU has no outputs. Requirements may name any variable: {shown}{more}"))
    # Nothing may be searched, or found to hold, before somebody has said what is required.
    formula = f"G[0,{shortest(stop_time)}] ({name_text(candidates[0].name)} <= {PLACEHOLDER})"
    lines.append(
        _noted(f"formula = {_formula_item(formula).as_string()}", "replace with the real requirement")
    )
    return "\n".join([*lines, 'description = ""'])


def _range(v: Variable, low: float, high: float) -> str:
    """Return a range; with integer bounds if the variable has only integer values."""
    return str([float(low), float(high)] if v.kind == "real" else [floor(low), ceil(high)])


def _toml(value: object) -> str:
    return tomlkit.item(value).as_string()


def _formula_item(formula: str) -> Item:
    """Return a literal string, in which quotes need no escapes, if TOML allows that."""
    return tomlkit.string(formula, literal=formula.isprintable() and "'" not in formula)


def _noted(line: str, comment: str) -> str:
    return f"{line}  {_comment(comment)}" if comment else line


def _comment(text: str) -> str:
    return f"# {one_line(text)}"


@dataclass(frozen=True, slots=True)
class Subject:
    """A model that a new requirement is about."""

    problem: Problem  # model, ranges and experiment; its requirement is another one
    path: Path  # the spec file, to whose folder its paths are relative
    text: str  # content of that file, or of a starter spec for it
    is_new: bool  # whether that is a starter, which is not written yet
    free_grid: bool  # whether the output interval may follow the formula

    @property
    def is_started(self) -> bool:
        """Whether its first requirement is a starter's, still without its number."""
        formula = tomllib.loads(self.text)["requirements"].get(_STARTED, {}).get("formula")
        is_ours = isinstance(formula, str) and formula.endswith(f"<= {PLACEHOLDER})")
        return is_ours and PLACEHOLDER not in self.problem.info

    def parsed(self, text: str) -> tuple[Formula, Problem]:
        """Return a formula that fits, and the problem with the time grid on which it is judged.

        Raises:
            SpecError: with the position of the mistake, the unknown signal, or the window that does not fit.
        """
        problem, experiment = self.problem, self.problem.experiment
        if self.free_grid:
            steps = {"internal_step": problem.info.internal_step, "step_size": experiment.step_size}
            steps["fmu_step"] = experiment.output_interval
            try:
                fits = fitting_interval(parse(text), experiment.stop_time, **steps)
            except FormulaError as error:
                raise SpecError(str(error)) from None
            experiment = replace(experiment, output_interval=fits or experiment.output_interval)
        return parse_requirement(text, problem.info, experiment), replace(problem, experiment=experiment)


def subject_of(target: str) -> Subject:
    """Return what a spec, a bundled name or an FMU says of the model.

    Raises:
        SpecError: if the target is none of these.
        ModelError: if the FMU cannot be read.
    """
    if target.lower().endswith(MODEL_FILES):
        fmu = Path(target)
        if not fmu.is_file():
            raise SpecError(f"{absent(fmu)}; give the path of an FMU or SSP package, or a spec")
        info = read_package(fmu).info if is_package(fmu) else read_info(fmu)
        starter, text = fmu.with_suffix(".toml"), starter_spec(Path(fmu.name), info)
        return Subject(problem_of_starter(text, starter), starter, text, is_new=True, free_grid=True)
    path, requirement = find_spec(target)
    free_grid = read_spec(path).model.output_interval is None
    text = path.read_bytes().decode("utf-8-sig")  # with its line ends
    problem = problem_of_starter(text, path, requirement or "", searches=False)
    return Subject(problem, path, text, is_new=False, free_grid=free_grid)


def problem_of_starter(text: str, path: Path, name: str = "", *, searches: bool = True) -> Problem:
    """Return the problem of a spec, such as a starter, with another requirement than its own.

    Its paths are relative to the folder of the file ``path``, for which it is meant. What a requirement
    changes holds for that one alone.

    Raises:
        SpecError: if anything else of it is not valid, or it has no requirement of this name.
    """
    spec = parse_spec(tomllib.loads(text), file=str(path))
    others = dict.fromkeys(spec.requirements, RequirementSection(formula=_ANY))
    spec = spec.model_copy(update={"requirements": others})
    return Problem.of(join(spec, name or next(iter(others)), path=path, searches=searches))


def with_requirement(subject: Subject, out: Path, formula: str, *, description: str) -> tuple[str, str]:
    """Return the spec's text with one more requirement, and its name; comments are kept.

    The name is the first free one of R1, R2, ... Relative paths become those from the folder of ``out``, to
    which the text will be written.
    """
    document = tomlkit.parse(subject.text)
    if subject.path.parent.resolve() != out.resolve().parent:
        _move(document, subject.path.parent, out)
    requirements: Any = document["requirements"]
    if subject.is_started:
        del requirements[_STARTED]
    name = next(f"R{k}" for k in range(1, len(requirements) + 2) if f"R{k}" not in requirements)
    table = tomlkit.inline_table() if isinstance(requirements, InlineTable) else tomlkit.table()
    table.add("formula", _formula_item(formula))
    table.add("description", description)
    requirements[name] = table
    text = tomlkit.dumps(document)
    if "\r\n" in subject.text:  # what is new has other line ends
        text = text.replace("\r\n", "\n").replace("\n", "\r\n")
    parse_spec(tomllib.loads(text), file=str(out))
    return text, name


def _move(section: Any, folder: Path, out: Path) -> None:
    """Let relative paths in a spec, a requirement or a profile begin in the folder of another file."""

    def moved(path: object) -> str:
        given = Path(str(path))
        return str(path) if given.is_absolute() else seen_from(out, folder / given).as_posix()

    for each in (section, section.get("model", {}), *section.get("components", {}).values()):
        if "fmu" in each:
            each["fmu"] = moved(each["fmu"])
        if "allow" in each:
            each["allow"] = list(with_paths(each["allow"], moved))
    context, parameters = section.get("context", {}), section.get("parameters", {})
    files = list(context.get("files", ()))
    for key in ("files", "checked"):
        if key in context:
            context[key] = [moved(name) if name in files else name for name in context[key]]
    for name, stated in parameters.items():
        place, key = (stated, "value") if isinstance(stated, dict) else (parameters, name)
        text = place.get(key)
        if isinstance(text, str) and named_file(text, folder) != text:  # a string that names a file
            place[key] = moved(text)
    for each in (*section.get("requirements", {}).values(), *section.get("profiles", {}).values()):
        _move(each, folder, out)
