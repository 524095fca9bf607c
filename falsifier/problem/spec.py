"""Spec files: the TOML schema, its defaults and its errors.

A spec contains a model, what may be varied, and requirements. Profiles are alternative parameterizations. For
inputs, parameters and the experiment, a requirement or a profile overrides the file's defaults; the last of
these sections that sets a key wins::

    file < requirement < profile < the profile's section on that requirement
"""

import re
import tomllib
from collections.abc import Mapping, Sequence
from functools import reduce
from operator import or_
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from pydantic import BaseModel, Discriminator, Field, Tag, ValidationError, ValidationInfo, field_validator

from falsifier.core.literals import one_line, toml_key
from falsifier.errors import SpecError, did_you_mean, in_section, key_of, rejected
from falsifier.fmu import is_package
from falsifier.problem import sections
from falsifier.problem.template_arguments import Template
from falsifier.problem.templates import TEMPLATES

Section = TypeVar("Section", bound=BaseModel)
Profiles = dict[str, sections.ProfileSection]
# Names that we choose stand in messages, tables and titles.
NAME_IN_LINES = "expected a name of one line without control characters and invisible ones"
# Limits of a spec file: the time to read nested keys grows with the square of their depth.
_MAX_LENGTH = 1_000_000
_MAX_KEY_PARTS = 500
_KEY = re.compile(r"""(?<![\w"'-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+)++""")
# How files begin that Windows programs, such as PowerShell's >, write in UTF-16.
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
# What an error of TOML, with what stands at its place and the whole line below, contains, and what to write
# instead; the first that is found is told.
_CURES = {
    r"\): [\u2018-\u201e]": "write straight quotes",
    r"Unescaped|hex value|Invalid value.*\\": "write backslashes, as of a path, in single quotes",
    r"Invalid value.*\): [^\W\d]": "write texts in quotes, true and false in small letters",
    r"=\s*[-+]?\d+,\d": "write decimals with a point",
    r"Cannot (overwrite|declare)": "state every key and every table once",
    r"Expected '(\]' at.*\): [^#\n].*\]|=' .*\): [^:\"'\n<>=!]+=[^=])": "quote names with more than ASCII"
    " letters, digits, _ and -",
}
_LONGEST_LINE = 80  # characters of it that are shown
# Parts of pydantic's locations that are no keys.
_STEPS = ("tuple", "function-before")
# What to write if a section of a name is no table.
_TABLES = {
    "inputs": "[inputs.{0}] with range = [low, high] or value",
    "parameters": "[parameters.{0}] with range = [low, high], or {0} = a single value",
    "requirements": "[requirements.{0}] with formula = '...'",
    "components": "[components.{0}] with fmu = '...'",
}


# Pydantic's locations have the kind of a requirement as a tag between its name and its keys.
def _kind_of_requirement(section: object) -> str | None:
    """Return which section a requirement is; None if there is no such template."""
    name = section.get("template") if isinstance(section, Mapping) else getattr(section, "template", None)
    if name is None:
        return "<formula>"
    return f"<{name}>" if isinstance(name, str) and name in TEMPLATES else None


if TYPE_CHECKING:
    AnyRequirement = sections.RequirementSection | Template
else:
    _KINDS = {"formula": sections.RequirementSection, **TEMPLATES}
    _TAGGED = (Annotated[kind, Tag(f"<{name}>")] for name, kind in _KINDS.items())
    AnyRequirement = Annotated[reduce(or_, _TAGGED), Discriminator(_kind_of_requirement)]


class Spec(sections.Section):
    """A whole spec file."""

    model: sections.ModelSection = Field(default_factory=sections.ModelSection)
    components: sections.Components = Field(default_factory=dict)
    connections: sections.Connections = Field(default_factory=dict)
    coupling: sections.CouplingSection = Field(default_factory=sections.CouplingSection)
    context: sections.ContextSection = Field(default_factory=sections.ContextSection)
    inputs: sections.Inputs = Field(default_factory=dict)
    parameters: sections.Parameters = Field(default_factory=dict)
    requirements: dict[str, AnyRequirement] = Field(
        min_length=1, description="What to falsify, as [requirements.NAME]."
    )
    profiles: Profiles = Field(default_factory=dict)

    @field_validator("profiles")
    @classmethod
    def _are_required(cls, found: Profiles, stated: ValidationInfo) -> Profiles:
        known = stated.data.get("requirements", {})
        for profile, section in found.items():
            if unknown := next((name for name in section.requirements if name not in known), None):
                raise ValueError(f"{profile}: no requirement {unknown!r}; {did_you_mean(unknown, known)}")
        return found

    @property
    def is_system(self) -> bool:
        """Whether it has components, or an SSP package in place of an FMU."""
        return self.model.fmu is None or is_package(self.model.fmu)

    @field_validator("requirements")
    @classmethod
    def _are_named(cls, found: dict[str, AnyRequirement]) -> dict[str, AnyRequirement]:
        if not all(map(str.strip, found)):
            raise ValueError("a requirement has an empty name; write [requirements.NAME]")
        return found

    def changes(self, requirement: str, profile: str | None) -> dict[str, sections.ModelChanges]:
        """Return the sections that apply to this requirement with this profile; later ones override."""
        place = f"requirements.{requirement}"
        layers: dict[str, sections.ModelChanges] = {place: self.requirements[requirement]}
        if profile is not None:
            layers[f"profiles.{profile}"] = self.profiles[profile]
            if requirement in self.profiles[profile].requirements:
                layers[f"profiles.{profile}.{place}"] = self.profiles[profile].requirements[requirement]
        return layers


def read_spec(path: Path) -> Spec:
    """Read and validate a spec file; SpecError naming the file, the key and what was expected."""
    with in_section(str(path)):
        text = _text_of(path)
        if len(text) > _MAX_LENGTH:
            raise SpecError(f"has {len(text):,} characters, more than {_MAX_LENGTH:,}")
        if any(key[0].count(".") > _MAX_KEY_PARTS for key in _KEY.finditer(text)):
            raise SpecError(f"has a key of more than {_MAX_KEY_PARTS} parts")
        try:
            data = tomllib.loads(text)
        except (ValueError, RecursionError) as error:  # also integers of too many digits, and deep nesting
            said = re.sub(r"',?\)", "]", str(error).replace("('", "[").replace("', '", "."))  # of keys
            if not isinstance(error, tomllib.TOMLDecodeError):
                deep = isinstance(error, RecursionError)
                said = "lists or tables are nested too deep" if deep else "a whole number has too many digits"
            at = re.search(r"\(at line (\d+), column (\d+)\)$", said)
            line = text.split("\n")[int(at[1]) - 1] if at else ""
            there = f"{said}: {line[int(at[2]) - 1 :]}\n{line}" if at else said
            hint = next((f"; {hint}" for mistake, hint in _CURES.items() if re.search(mistake, there)), "")
            shown = f": {one_line(line)[:_LONGEST_LINE]}" if line else ""
            raise SpecError(f"not valid TOML: {said}{shown}{hint}") from None
        if not data:
            raise SpecError(
                "the file contains nothing; write [model], [inputs.NAME] and [requirements.NAME], or let "
                "`falsifier init MODEL.fmu` write a spec to begin with"
            )
    return parse_spec(data, file=str(path))


def _text_of(path: Path) -> str:
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise SpecError("no such spec file; `falsifier init MODEL.fmu` writes one") from None
    except OSError as error:
        raise SpecError(f"cannot be read ({error.strerror}); expected the text of a spec") from None
    try:
        return content.decode("utf-8-sig")  # some editors begin files with a byte order mark
    except UnicodeDecodeError as error:
        found = "is written in UTF-16" if content.startswith(_UTF_16) else f"cannot be read: {error}"
        raise SpecError(f"{found}; specs are UTF-8: save the file with this encoding") from None


def parse_spec(data: Mapping[str, Any], *, file: str) -> Spec:
    """Validate a spec's content, as parsed from TOML; SpecError naming file, key and what was expected."""
    with in_section(file):
        try:
            spec = Spec.model_validate(data)
        except ValidationError as error:
            raise _error_of(error) from None
        for section in ("requirements", "profiles", "components"):
            for name in getattr(spec, section):
                if one_line(name) != name:
                    raise SpecError(NAME_IN_LINES, key=f"{section}.{name!r}")
        _check_model(spec)
    return spec


def _check_model(spec: Spec) -> None:
    """Check that a spec has either an FMU or components."""
    if spec.model.fmu is None and not spec.components:
        raise SpecError(sections.missing(sections.ModelSection.model_fields["fmu"]), key="model.fmu")
    if spec.components and spec.model.fmu is not None:
        raise SpecError("a spec has one FMU here or [components.NAME]; remove one of them", key="model.fmu")
    is_coupled = spec.coupling != sections.CouplingSection()
    if (spec.connections and not spec.components) or (is_coupled and not spec.is_system):
        key = "connections" if spec.connections else "coupling"
        raise SpecError("only a system has this section: add [components.NAME]", key=key)


def overlay(base: Section | None, changes: Section) -> Section:
    """Return ``base`` with the keys replaced that ``changes`` sets."""
    if base is None:
        return changes
    stated = {name: getattr(changes, name) for name in changes.model_fields_set}
    if isinstance(base, sections.InputSection | sections.ParameterSection):
        if "value" in stated:  # a fixed value replaces a searched range and vice versa
            return changes
        stated.setdefault("value", None)
        # Control points or interpolation that are overridden are meant to be used: no free parameterization.
        if {"control_points", "interpolation"} & stated.keys():
            stated.setdefault("free", None)
    return base.model_copy(update=stated)


def _error_of(error: ValidationError) -> SpecError:
    """Return the error to raise for the first thing that is wrong."""
    first = error.errors()[0]
    where, given = [part for part in first["loc"] if part not in _STEPS], first["input"]
    message = rejected(first["msg"], given)
    if where[:1] == ["requirements"] and len(where) > 2:
        where.pop(2)  # below the name of a requirement comes the tag of its kind, which is no key
    section, name = ("", "", *where)[-2:]
    shown_name = toml_key(str(name)) if name else ""
    if first["type"] == "union_tag_not_found":
        where.append("template")
        message = f"no such template; {did_you_mean(str(given.get('template')), TEMPLATES)}"
    elif first["type"] == "wrong_key":
        wrong = first["ctx"]["key"]
        if wrong == "formula" and "template" in given:
            message = "this requirement has a template, too; give one of the two"
        elif section == "parameters" and wrong in sections.InputSection.model_fields:
            message = f"only inputs have {wrong}: write [inputs.{shown_name}] if it is one"
        elif quoted := _unquoted(where, wrong, given):
            is_near = message.startswith("unknown key; did you mean") and "=" in quoted
            said = f"names with dots are written in quotes: {quoted}"
            return SpecError(f"{message}; {said}" if is_near else said, key=key_of(where[:2]))
        where.append(wrong)
    elif section in _TABLES and not isinstance(given, Mapping):
        message = f"expected a table: {_TABLES[str(section)].format(shown_name)}"
    return SpecError(message, key=key_of(where))


def _unquoted(where: Sequence[str | int], key: str, given: Mapping[str, Any]) -> str:
    """Return how to write a dotted name that TOML has read as nested tables; empty if there is none."""
    section, name, value = *("", "", *where)[-2:], given.get(key)
    quoted = f'"{name}.{key}"'
    if section in ("inputs", "parameters") and isinstance(value, dict):
        return f"[{section}.{quoted}]"
    dotless = not {"range", "value"} & given.keys() if section == "parameters" else "." not in str(name)
    is_list = isinstance(value, list)  # of which no fixed value consists
    is_dotted = section == "connections" or (section == "parameters" and not is_list)
    return f"{quoted} = ..." if is_dotted and dotless and value is not None else ""
