"""What is wrong with a spec file, as errors that name the file, the key and what was expected."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from falsifier.errors import SpecError, did_you_mean, rejected
from falsifier.problem.templates import TEMPLATES

# Parts of pydantic's locations that are no keys.
_STEPS = ("tuple", "function-before")
# Sections of which there is one, without a name of its own.
_SINGLE = ("model", "free", "coupling", "context")


def spec_error(
    error: ValidationError, file: str, root: type[BaseModel], sections: Mapping[str, type[BaseModel]]
) -> SpecError:
    """Return the error to raise for the first thing that is wrong.

    Args:
        error: what pydantic found.
        file: name of the file.
        root: the whole spec.
        sections: its sections by the key that holds them; in angle brackets by the kind of a requirement.
    """
    first = error.errors()[0]
    where = [str(part) for part in first["loc"] if part not in _STEPS]
    location = _keys_of(where)
    key = ".".join(location)
    kind = first["type"]
    if kind == "union_tag_not_found":
        known = did_you_mean(str(first["input"].get("template")), TEMPLATES)
        return SpecError(f"no such template; {known}", file=file, key=f"{key}.template")
    if kind in ("extra_forbidden", "missing") and (quoted := _unquoted(error)):
        return SpecError(
            f"names with dots are written in quotes: {quoted}", file=file, key=".".join(location[:2])
        )
    if kind == "extra_forbidden":
        known = did_you_mean(location[-1], sorted(_fields(where[:-1], root, sections)))
        return SpecError(f"unknown key; {known}", file=file, key=key)
    if kind == "missing":
        field = _fields(where[:-1], root, sections).get(location[-1])
        meaning = f" ({field.description})" if field is not None and field.description else ""
        return SpecError(f"this key is missing{meaning}", file=file, key=key)
    return SpecError(rejected(first["msg"], first["input"]), file=file, key=key)


def _keys_of(where: list[str]) -> list[str]:
    return [
        part for part in where if not (part.startswith("<") and part.strip("<>") in (*TEMPLATES, "formula"))
    ]


def _unquoted(error: ValidationError) -> str:
    """Return how to write a dotted name that TOML has read as nested tables; empty if there is none."""
    for each in error.errors():
        location = [str(part) for part in each["loc"]]
        if each["type"] != "extra_forbidden" or len(location) < 3:
            continue
        section, *names = location[-3:]
        name = f'"{".".join(names)}"'
        if section in ("inputs", "parameters") and isinstance(each["input"], dict):
            return f"[{section}.{name}]"
        is_quoted = "." in names[0]
        if section == "parameters" or (section == "connections" and not is_quoted):
            return f"{name} = ..."
    return ""


def _fields(
    where: list[str], root: type[BaseModel], sections: Mapping[str, type[BaseModel]]
) -> dict[str, Any]:
    """Return the fields of the section at this location in a spec."""
    if where and where[-1] not in _keys_of(where[-1:]):
        return dict(sections[where[-1]].model_fields)
    fields = dict(root.model_fields)
    location = _keys_of(where)
    for i, part in enumerate(location):
        if part in _SINGLE:
            fields = dict(sections[part].model_fields)
        elif i > 0 and location[i - 1] in sections and location[i - 1] not in _SINGLE:
            fields = dict(sections[location[i - 1]].model_fields)
    return fields
