"""Conversion of Python values and command-line options to the sections of a spec."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import ValidationError

from falsifier.core.arguments import instance, texts
from falsifier.core.literals import number_in, shortest
from falsifier.core.model import Interface
from falsifier.core.ranges import Scale
from falsifier.errors import SpecError, did_you_mean, first_fault, in_section, naming, setting, shown, written
from falsifier.fmu import Rights, resolved
from falsifier.problem.sections import InputSection, ModelChanges, ParameterSection, RequirementSection
from falsifier.problem.spec import AnyRequirement, parse_spec
from falsifier.problem.templates import TEMPLATES
from falsifier.stl.lexer import RESERVED

# Keys that the option of the same name states; --set and --search state inputs and parameters.
KEYS_WITH_OPTION = ("interface", "stop_time", "output_interval", "time_limit", "omit", "allow", "deny")

_QUOTED = r"""(?:"(?:[^"\\]|\\.)*"|'[^']*')"""
# A template and its first argument; no formula begins like this.
_TEMPLATE = re.compile(r"\s*([a-z_]+)\s+\w+\s*=(?!=)")
# What may follow the ends of an input's range, and of a parameter's.
_OF_INPUTS, _OF_PARAMETERS = ("control_points", "interpolation"), ("scale",)
# One argument of a template: spaces only in quotes and in lists.
_ARGUMENT = re.compile(rf"""(?:=\[(?:{_QUOTED}|[^"'\]])*\]|{_QUOTED}|[^\s"'])+""")

# A number or the name of an item.
Value = float | str
# A constant value; (low, high) to search, with the spec's control points or else free; (low, high, points) or
# (low, high, points, interpolation) to search with these; None to search between the FMU's min and max; or a
# complete section of a spec.
InputChoice = (
    Value
    | tuple[Value, Value]
    | tuple[Value, Value, int]
    | tuple[Value, Value, int, str]
    | InputSection
    | None
)
# A value, or text for a string; a range to search, evenly or in decades: (low, high, "log"); None to search
# between the FMU's min and max; or a complete section of a spec.
ParameterChoice = Value | tuple[Value, Value] | tuple[Value, Value, Scale] | ParameterSection | None

Choice = TypeVar("Choice")


def changes_from(
    *,
    inputs: Mapping[str, InputChoice] | None = None,
    parameters: Mapping[str, ParameterChoice] | None = None,
    omit: Iterable[str] = (),
    allow: Iterable[str] = (),
    deny: Iterable[str] = (),
    **experiment: float | Interface | None,
) -> ModelChanges:
    """Return the changes for Python values.

    Paths in ``allow`` begin in the current folder. What else is given are fields of ModelChanges; None leaves
    a field unchanged.

    Raises:
        SpecError: naming the input, parameter or field that is invalid.
    """
    inputs, parameters = inputs or {}, parameters or {}
    data: dict[str, Any] = {name: value for name, value in experiment.items() if value is not None}
    instance("inputs", inputs, Mapping, "choices by name, such as {'u': (0, 1)}")
    instance("parameters", parameters, Mapping, "choices by name, such as {'p': 1.5}")
    for what, choices in (("inputs", inputs), ("parameters", parameters)):
        if wrong := [n for n in choices if not isinstance(n, str)]:
            raise SpecError(f"{what}: names must be text, got the key {wrong[0]!r}")
        data[what] = {name: _section(what, name, _from_numpy(c)) for name, c in choices.items()}
    _check_apart(inputs, parameters)
    listed = {"omit": texts("omit", omit), **given_rights(allow, deny)}
    data |= {name: words for name, words in listed.items() if words}
    try:
        return ModelChanges.model_validate(data)
    except ValidationError as error:
        key, message = first_fault(error)
        kind, name = (*error.errors()[0]["loc"], "")[:2]
        if kind in ("inputs", "parameters"):
            searched = kind == "inputs" or "range" in data[kind].get(name, ())
            key = written(stated_as(str(kind), str(name), searched=searched), key)
        else:
            key = setting(key)
        raise SpecError(message, file=key) from None


def _check_apart(inputs: Iterable[str], parameters: Iterable[str]) -> None:
    if both := sorted(set(inputs) & set(parameters)):
        why = written("--set keeps it constant, --search varies it", "given in inputs and in parameters")
        raise SpecError(f"{both[0]}: {why}; drop one of them")


def given_rights(allow: Iterable[str], deny: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return what options or arguments allow and deny, with absolute paths; SpecError naming a wrong one."""
    rights = {"allow": resolved(texts("allow", allow), Path()), "deny": texts("deny", deny)}
    for name, words in rights.items():
        with naming(setting(name)):
            Rights.of(**{name: words})
    return rights


def stated_as(kind: str, name: str, *, searched: bool) -> str:
    """Return how the reader names the option or argument that states an input or a parameter."""
    return written(f"--{'search' if searched else 'set'} {name}", f"{kind}.{name}")


def searching(kind: str, name: str) -> str:
    """Return what the reader writes to search an input or a parameter."""
    return written(f"--search {name}=LOW:HIGH", f"{kind}={{{name!r}: (LOW, HIGH)}}")


def changes_from_options(
    *, values: Iterable[str] = (), ranges: Iterable[str] = (), **more: Any
) -> ModelChanges:
    """Return the changes for command-line options.

    Whether a name is an input or a parameter is known when the changes are joined with the model.

    Args:
        values: ``name=value`` (an input is kept constant, a parameter or start value set) or ``name=text`` (a
            string; a file is named relative to the current folder).
        ranges: ``name=low:high`` (an input is searched with the spec's control points, or else a free
            parameterization), ``name=low:high:points``, ``name=low:high:points:interpolation``,
            ``name=low:high:log`` (a parameter is searched in decades), or ``name`` (searched as in the spec,
            or between the FMU's min and max).
        more: ``allow``, ``deny`` and fields of ModelChanges; see ``changes_from``.

    Raises:
        SpecError: naming the option that is invalid.
    """
    constant: dict[str, Any] = _once("--set", map(_value, values))
    searched: dict[str, Any] = _once("--search", map(_range, ranges))
    _check_apart(searched, constant)
    # What names a scale can be a parameter only.
    for name, choice in list(searched.items()):
        if isinstance(choice, tuple) and choice[2:3] and choice[2] in get_args(Scale):
            constant[name] = searched.pop(name)
    return changes_from(inputs=searched, parameters=constant, **more)


def options_from(changes: ModelChanges) -> list[tuple[str, str]]:
    """Return the command-line options for these changes, the inverse of ``changes_from_options``.

    >>> options_from(changes_from_options(ranges=["u=0:1:3"], stop_time=5.0))
    [('--search', 'u=0:1:3'), ('--stop-time', '5.0')]
    """
    options = [_option(name, section) for name, section in changes.variables]
    for key in KEYS_WITH_OPTION:
        stated = getattr(changes, key)
        values = stated if isinstance(stated, tuple) else () if stated is None else (stated,)
        options += [(f"--{key.replace('_', '-')}", str(value)) for value in values]
    return options


def without_option(changes: ModelChanges) -> list[str]:
    """Return the keys of these changes, stated in Python, that ``options_from`` cannot say."""
    others = ModelChanges.model_fields.keys() - {*KEYS_WITH_OPTION, "logging", "inputs", "parameters"}
    keys = sorted(key for key in others if getattr(changes, key) is not None)
    for name, section in changes.inputs.items():
        is_whole = section.range is not None and section.control_points is not None
        said = ("range", "value", *(("control_points", "interpolation") if is_whole else ()))
        keys += [f"inputs.{name}.{key}" for key in section.model_dump(exclude_none=True) if key not in said]
    keys += [f"parameters.{name}.scale" for name, p in changes.parameters.items() if p.scale and not p.range]
    return keys


def _option(name: str, section: InputSection | ParameterSection) -> tuple[str, str]:
    if section.value is not None:
        return "--set", f"{name}={_said(section.value)}"
    if section.range is None:
        return "--search", name
    said = list(map(_said, section.range))
    if isinstance(section, ParameterSection):
        said += [section.scale] if section.scale else []
    elif section.control_points is not None:
        said += [str(section.control_points), *([section.interpolation] if section.interpolation else [])]
    return "--search", f"{name}={':'.join(said)}"


def _said(value: float | str) -> str:
    return value if isinstance(value, str) else shortest(value)


def _section(kind: str, name: str, choice: InputChoice | ParameterChoice) -> object:
    """Return the section that a choice for an input or a parameter stands for, or its keys."""
    own, keys = (ParameterSection, _OF_PARAMETERS) if kind == "parameters" else (InputSection, _OF_INPUTS)
    match choice:
        case None:
            return {}
        case InputSection() | ParameterSection() if isinstance(choice, own):
            return choice
        case int() | float() | str():
            is_file = kind == "parameters" and isinstance(choice, str)
            return {"value": named_file(str(choice), Path()) if is_file else choice}
        case (low, high, *more) if len(more) <= len(keys):
            return {"range": (low, high)} | dict(zip(keys, more, strict=False))
    said = "a number, (low, high[, points[, interpolation]])"
    said = said if own is InputSection else "a number, text, (low, high[, scale])"
    raise SpecError(f"{kind}.{name}: expected {said}, {own.__name__} or None, got {shown(choice)}")


def _from_numpy(choice: Any) -> Any:
    return choice.tolist() if hasattr(choice, "tolist") else choice


def named_file(text: str, folder: Path) -> str:
    """Return the absolute path if the text names a file, or a folder with a slash; otherwise the text."""
    path = folder / text
    try:
        is_path = path.is_file() or ("/" in text and path.is_dir())
    except (OSError, ValueError):
        return text
    return str(path.absolute()) if text and is_path else text


# -- texts of options ----------------------------------------------------------------------------------------


def _once(flag: str, choices: Iterable[tuple[str, Choice]]) -> dict[str, Choice]:
    found: dict[str, Choice] = {}
    for name, choice in choices:
        if name in found:
            raise SpecError(f"{flag} {name}: given twice; drop one of them")
        found[name] = choice
    return found


def _value(option: str) -> tuple[str, float | str]:
    name, _, said = (part.strip() for part in option.partition("="))
    if not name or not said:
        raise SpecError(f"--set {option}: expected NAME=VALUE, for example --set mass=1200")
    number = number_in(said)
    # Of a string, the text counts: 007.
    return name, said if number is None or shortest(number) != said else number


def _range(option: str) -> tuple[str, InputChoice]:
    name, equals, said = (part.strip() for part in option.partition("="))
    if name and not equals:
        return name, None
    with suppress(ValueError):  # of the points, or because there is no colon
        low, high, *more = (part.strip() for part in said.split(":"))
        is_scaled = more[:1] and more[0] in get_args(Scale)
        points = more[:1] if is_scaled else map(int, more[:1])
        choice: Any = (_end(low), _end(high), *points, *more[1:])
        if name and low and high and len(more) <= (1 if is_scaled else 2):
            return name, choice
    raise SpecError(
        f"--search {option}: expected NAME=LOW:HIGH[:POINTS[:INTERPOLATION]], for example --search "
        "throttle=0:100:7, or of a parameter NAME=LOW:HIGH:log; to keep it constant: "
        f"--set {name or 'throttle'}=VALUE"
    )


def _end(said: str) -> float | str:
    """Return an end of a range: a number, or else the name of an item."""
    number = number_in(said)
    return said if number is None else number


def requirement_of(text: str) -> AnyRequirement:
    """Return the requirement that a text states: a formula, or the name of a template and its arguments.

    Arguments are ``key=value`` in any order. Values are written as in TOML; text needs no quotes of its own
    unless it contains spaces.

    >>> requirement_of("settles signal=speed reference=80 within=2% time=3").expanded(50.0)
    'G[3,50] (abs(speed - 80) <= 1.6)'

    Raises:
        SpecError: naming the argument that is wrong, or what is not ``key=value``.
    """
    place = setting("stl")
    instance(place, text, str, "text")
    named = _TEMPLATE.match(text)
    if named is None or named[1] in RESERVED:
        return RequirementSection(formula=text)
    with in_section(place):
        arguments = _arguments(text)
        if beside := sorted(arguments.keys() & ModelChanges.model_fields.keys()):
            # It would shape the formula and not the simulation.
            raise SpecError(
                "it changes simulations, and is no argument of a template here: state it beside the "
                f"requirement ({setting('stop_time')}, ...), or write a spec with [requirements.NAME]",
                key=beside[0],
            )
        fields = TEMPLATES[named[1]].model_fields if named[1] in TEMPLATES else arguments
        if unknown := next((key for key in arguments if key not in fields), None):
            known = [name for name in fields if name not in (*ModelChanges.model_fields, "template")]
            raise SpecError(f"unknown key; {did_you_mean(unknown, known)}", key=unknown)
    try:
        spec = parse_spec({"model": {"fmu": "-"}, "requirements": {"R": arguments}}, file=place)
    except SpecError as error:
        key = (error.key or "").removeprefix("requirements.R").lstrip(".")
        raise SpecError(error.message, file=place, key=key or None) from None
    return spec.requirements["R"]


def _arguments(text: str) -> dict[str, Any]:
    if rest := _ARGUMENT.sub("", text).strip():
        raise SpecError(f"{rest}: a quote has no end")
    name, *pairs = _ARGUMENT.findall(text)
    found: dict[str, Any] = {"template": name}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or key in found or value.endswith(","):
            raise SpecError(
                f"{pair}: expected each argument of {name} once, as key=value without commas between them; "
                "spaces need quotes: when='speed > 5'"
            )
        try:
            found[key] = tomllib.loads(f"v = {value}")["v"]
        except (ValueError, RecursionError):  # also integers of too many digits, and deep nesting
            found[key] = value
    return found
