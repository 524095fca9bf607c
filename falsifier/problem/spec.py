"""Spec files: the TOML schema, its defaults and its errors.

A spec contains a model, what may be varied, and requirements. Profiles are alternative parameterizations. For
inputs, parameters and the experiment, a requirement or a profile overrides the file's defaults; the last of
these sections that sets a key wins::

    file < requirement < profile < the profile's section on that requirement
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import (
    BaseModel,
    Field,
    ValidationError,
)

from falsifier.core.literals import one_line
from falsifier.errors import SpecError
from falsifier.fmu.ssp import SUFFIXES as PACKAGES
from falsifier.problem.sections import (
    AnyRequirement,
    Components,
    ComponentSection,
    Connections,
    ConnectionSection,
    ContextSection,
    CouplingSection,
    DwellSection,
    FreeSection,
    Inputs,
    InputSection,
    ModelChanges,
    ModelSection,
    NeverTogetherSection,
    OrderSection,
    OvershootSection,
    Parameters,
    ParameterSection,
    ProfileSection,
    RampLimitSection,
    RequirementSection,
    ResponseSection,
    RiseSection,
    SettlesSection,
    StaysWithinSection,
    Strict,
)
from falsifier.problem.spec_errors import spec_error

Section = TypeVar("Section", bound=BaseModel)
# Limits of a spec file: the time to read nested keys grows with the square of their depth.
# Names that we choose stand in messages, tables and titles.
NAME_IN_LINES = "expected a name of one line without control characters"
_MAX_LENGTH = 1_000_000
_MAX_KEY_PARTS = 500


class Spec(Strict):
    """A whole spec file."""

    model: ModelSection = Field(default_factory=ModelSection)
    components: Components = Field(default_factory=dict)
    connections: Connections = Field(default_factory=dict)
    coupling: CouplingSection = Field(default_factory=CouplingSection)
    context: ContextSection = Field(default_factory=ContextSection)
    inputs: Inputs = Field(default_factory=dict)
    parameters: Parameters = Field(default_factory=dict)
    requirements: dict[str, AnyRequirement] = Field(min_length=1)
    profiles: dict[str, ProfileSection] = Field(default_factory=dict)

    def changes(self, requirement: str, profile: str | None) -> list[ModelChanges]:
        """Return the sections that apply to this requirement with this profile; later ones override."""
        layers: list[ModelChanges] = [self.requirements[requirement]]
        if profile is not None:
            layers.append(self.profiles[profile])
            if requirement in self.profiles[profile].requirements:
                layers.append(self.profiles[profile].requirements[requirement])
        return layers


# Sections by the key that holds them, or by the tag of a kind of requirement; for hints in error messages.
_SECTIONS: Mapping[str, type[BaseModel]] = {
    "model": ModelSection,
    "components": ComponentSection,
    "connections": ConnectionSection,
    "coupling": CouplingSection,
    "context": ContextSection,
    "inputs": InputSection,
    "parameters": ParameterSection,
    "requirements": ModelChanges,
    "profiles": ProfileSection,
    "free": FreeSection,
    "<formula>": RequirementSection,
    "<settles>": SettlesSection,
    "<overshoot>": OvershootSection,
    "<rise>": RiseSection,
    "<response>": ResponseSection,
    "<stays_within>": StaysWithinSection,
    "<never_together>": NeverTogetherSection,
    "<dwell>": DwellSection,
    "<ramp_limit>": RampLimitSection,
    "<order>": OrderSection,
}


def read_spec(path: Path) -> Spec:
    """Read and validate a spec file.

    Raises:
        SpecError: naming the file, the key and what was expected.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")  # some editors begin files with a byte order mark
    except FileNotFoundError:
        raise SpecError("no such spec file; `falsifier init MODEL.fmu` writes one", file=str(path)) from None
    except (OSError, UnicodeDecodeError) as error:
        raise SpecError(f"cannot be read: {error}", file=str(path)) from None
    if len(text) > _MAX_LENGTH:
        raise SpecError(f"has {len(text):,} characters, more than {_MAX_LENGTH:,}", file=str(path))
    if any(line.partition("=")[0].count(".") > _MAX_KEY_PARTS for line in text.splitlines()):
        raise SpecError(f"has a key of more than {_MAX_KEY_PARTS} parts", file=str(path))
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also integers of too many digits, and deep nesting
        raise SpecError(f"not valid TOML: {error}", file=str(path)) from None
    if not data:
        raise SpecError(
            "the file contains nothing; write [model], [inputs.NAME] and [requirements.NAME], or let "
            "`falsifier init MODEL.fmu` write a spec to begin with",
            file=str(path),
        )
    return parse_spec(data, file=str(path))


def parse_spec(data: Mapping[str, Any], *, file: str) -> Spec:
    """Validate the content of a spec file.

    Args:
        data: parsed TOML.
        file: name of the file in error messages.

    Raises:
        SpecError: naming the file, the key and what was expected.
    """
    try:
        spec = Spec.model_validate(data)
    except ValidationError as error:
        raise spec_error(error, file, Spec, _SECTIONS) from None
    for section in ("requirements", "profiles", "components"):
        for name in getattr(spec, section):
            if one_line(name) != name:
                raise SpecError(NAME_IN_LINES, file=file, key=f"{section}.{name!r}")
    _check_model(spec, file)
    return spec


def _check_model(spec: Spec, file: str) -> None:
    """Check that a spec has either an FMU or components."""
    if spec.model.fmu is None and not spec.components:
        about = ModelSection.model_fields["fmu"].description
        raise SpecError(f"this key is missing ({about})", file=file, key="model.fmu")
    if spec.components and spec.model.fmu is not None:
        raise SpecError(
            "a spec has either one FMU here or [components.NAME]; remove one of them",
            file=file,
            key="model.fmu",
        )
    is_system = bool(spec.components) or str(spec.model.fmu).endswith(PACKAGES)
    if (spec.connections and not spec.components) or (spec.coupling != CouplingSection() and not is_system):
        key = "connections" if spec.connections else "coupling"
        raise SpecError("only a system has this section: add [components.NAME]", file=file, key=key)


def overlay(base: Section | None, changes: Section) -> Section:
    """Return ``base`` with the keys replaced that ``changes`` sets."""
    if base is None:
        return changes
    stated = {name: getattr(changes, name) for name in changes.model_fields_set}
    if isinstance(base, InputSection):
        if "value" in stated:  # a fixed value replaces a searched range and vice versa
            return changes
        stated.setdefault("value", None)
        # Control points or interpolation that are overridden are meant to be used: no free parameterization.
        if {"control_points", "interpolation"} & stated.keys():
            stated.setdefault("free", None)
    if isinstance(base, ParameterSection):
        return changes
    return base.model_copy(update=stated)
