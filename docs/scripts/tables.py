"""Tables made from the code, so that they cannot drift: keys of spec files, engines, prompt variants.

A page asks for one by a comment on a line of its own: ``<!-- keys InputSection -->``, ``<!-- engines -->``,
``<!-- variants -->``.
"""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, get_args

from mkdocs.exceptions import PluginError

from falsifier.engines import DEFAULT_ENGINE, ENGINES
from falsifier.llm import DEFAULT_VARIANT
from falsifier.llm.prompts import VARIANTS
from falsifier.llm.prompts.view import Part
from falsifier.problem.sections import ModelChanges
from falsifier.problem.spec import Spec

_MARK = re.compile(r"^<!-- (keys|engines|variants)(?: (\w+))? -->$", re.MULTILINE)
# Where a section's table stands in docs/spec.md.
_SECTIONS = {
    "ModelSection": ("a table", "model"),
    "InputSection": ("tables", "inputsname"),
    "ParameterSection": ("tables", "parametersname"),
    "RequirementSection": ("tables", "requirementsname"),
    "ProfileSection": ("tables", "profilesname"),
    "FreeSection": ("a table", "free-control-points"),
    "ModelChanges": ("tables", "what-a-requirement-or-a-profile-may-change"),
}
_PARTS: Mapping[Part, str] = {
    "names": "names and meanings of inputs and parameters; otherwise numbered dimensions",
    "requirement": "the formula",
    "outputs": "names of the signals in the formula",
    "values": "per sample: outputs at the times of the control points",
    "critical": "per sample: critical time and signal values there",
    "guidance": "what to consider, as the published prompts say",
    "advice": "advice that fits the problem",
    "system": "description of the model, all recorded signals with units and descriptions",
    "reading": "the formula in plain words, its terms as signals of their own",
    "freedom": "control points and interpolation may be chosen, if the spec allows it",
    "observations": "per sample: course of all signals, what decided, robustness of the parts of the formula",
    "history": "all samples, what each was the first to reach, and its rationale; earlier ones stay as told",
    "lessons": "what the language model wrote down for itself in its last reply",
    "circumstances": "the budget and what is left of it, the outputs at time 0",
    "failures": "samples that could not be simulated, with the reason",
    "context": "what named files say: excerpts, and constants beside the signals that they are compared with",
}


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace the marks of a page by tables."""
    return _MARK.sub(lambda mark: _TABLES[mark[1]](mark[2]), markdown)


def _keys(section: str) -> str:
    """Keys of one section of a spec file, from its JSON Schema."""
    schema = Spec.model_json_schema()
    sections = {**schema["$defs"], "Spec": schema}
    if section not in sections:
        raise PluginError(f"there is no section {section} in spec files: {', '.join(sections)}")
    properties = sections[section]["properties"]
    is_template = "template" in properties
    if is_template or section in ("RequirementSection", "ProfileSection"):  # ModelChanges has its own table
        properties = {k: v for k, v in properties.items() if k not in ModelChanges.model_fields}
    if is_template:  # these are the same for all
        properties = {k: v for k, v in properties.items() if k not in ("template", "description")}
        properties["during"] = properties.pop("during")  # after its own arguments
    if section == "ModelSection":  # its own keys first: what is simulated, then how
        properties = dict(sorted(properties.items(), key=lambda item: item[0] in ModelChanges.model_fields))
    required = sections[section].get("required", ())
    rows = [
        (f"`{key}`", _type(said), "yes" if key in required else "", _meaning(said))
        for key, said in properties.items()
    ]
    return table(("key", "value", "required", "meaning"), rows)


def _meaning(said: Mapping[str, Any]) -> str:
    meaning = str(said.get("description", ""))
    default = said.get("default")
    if default in (None, "", [], {}, False) or "default" in meaning.lower():
        return meaning
    return f"{meaning.removesuffix('.')}; default: `{json.dumps(default)}`.".removeprefix("; ")


def _type(said: Mapping[str, Any]) -> str:
    """What a value is, in the words of TOML."""
    if "$ref" in said:
        name = said["$ref"].rpartition("/")[2]
        if name not in _SECTIONS:
            raise PluginError(
                f"docs/spec.md has no table of {name}: add it, and say in {__file__} where it is"
            )
        what, place = _SECTIONS[name]
        return f"[{what}](#{place})"
    if "anyOf" in said:
        return " or ".join(_type(each) for each in said["anyOf"] if each.get("type") != "null")
    if "enum" in said:
        return ", ".join(f'`"{value}"`' for value in said["enum"])
    if "prefixItems" in said:
        return f"`[{', '.join(_type(each) for each in said['prefixItems'])}]`"
    if said["type"] == "array":
        return f"list of {said['items']['type']}s"
    if said["type"] == "object":
        return _type(said["additionalProperties"])
    limits = [f"> {said['exclusiveMinimum']:g}"] if "exclusiveMinimum" in said else []
    limits += [f">= {said['minimum']:g}"] if "minimum" in said else []
    limits += [f"<= {said['maximum']:g}"] if "maximum" in said else []
    return f"{said['type']} {', '.join(limits)}".rstrip()


def _engines(_: str | None) -> str:
    rows = [
        (
            f"`{name}`" + (" (default)" if name == DEFAULT_ENGINE else ""),
            engine.summary,
            f"`pip install 'falsifier[{engine.extra}]'`" if engine.extra else "",
        )
        for name, engine in ENGINES.items()
    ]
    return table(("engine", "what it does", "needs"), rows)


def _variants(_: str | None) -> str:
    if _PARTS.keys() != set(get_args(Part)):
        raise PluginError(f"prompts have other parts than {__file__} describes: {get_args(Part)}")
    names = [f"{name} (default)" if name == DEFAULT_VARIANT else name for name in VARIANTS]
    rows = [
        (meaning, *("x" if variant.has(part) else "" for variant in VARIANTS.values()))
        for part, meaning in _PARTS.items()
    ]
    return table(("part", *names), rows)


def table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """Return a table in Markdown."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


_TABLES: Mapping[str, Callable[[Any], str]] = {"keys": _keys, "engines": _engines, "variants": _variants}
