"""Sources of problems: what is needed to load a problem again, in another process or from a journal."""

from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError, field_serializer

from falsifier.core.files import bundled
from falsifier.core.strict import Strict
from falsifier.errors import SpecError, first_fault
from falsifier.fmu.ssp.package import SUFFIXES as PACKAGES
from falsifier.problem.sections import ModelChanges, Number, Recordable

# Name of the requirement that a formula makes if it is given without a name.
STL_NAME = "stl"
# Endings of files that are a model themselves; all others need a spec.
MODEL_FILES = (".fmu", *PACKAGES)

Parameterization = Literal["free", "fixed"]


@dataclass(frozen=True, slots=True)
class Target:
    """What a target means; requirement names may contain anything, colons and file endings too."""

    # ``spec`` file, ``fmu`` or SSP package, ``python`` for a problem made in Python, or ``bundled``.
    kind: Literal["spec", "fmu", "python", "bundled"]
    file: str = ""  # path of the spec file or the FMU; empty for the other kinds
    requirement: str = ""  # name of the requirement, or of the problem made in Python; empty if there is none

    @classmethod
    def parse(cls, text: str) -> "Target":
        """Return the parts of a target.

        >>> Target.parse("specs/AT.toml:AT1").requirement, Target.parse("AT:AT1").requirement
        ('AT1', 'AT1')
        """
        if text.startswith("python:"):
            return cls("python", requirement=text.rpartition(":")[2])
        path, colon, requirement = text.partition(".toml:")
        if colon or text.endswith(".toml"):
            return cls("spec", f"{path.removesuffix('.toml')}.toml", requirement)
        if text.lower().endswith(MODEL_FILES):
            return cls("fmu", text)
        return cls("bundled", requirement=text.partition(":")[2])


class ProblemSource(Strict):
    """A spec's requirement, or an FMU with a formula, and changes to either.

    Attributes:
        target: ``file.toml:REQ``, ``file.fmu``, a bundled name such as ``AT1``, or ``python:MODULE:NAME``: a
            Problem made in Python, or a function that returns one.
        stl: formula, or template with its arguments, to use instead of the spec's requirement.
        stl_name: name of the requirement that this formula makes.
        profile: name of a profile of the spec.
        parameterization: ``free``: engines may choose control points within the spec's limits; ``fixed``:
            only the control points of the spec are allowed.
        shortest_piece: minimum time in s between two control points of every input, which makes all inputs
            free; None: the spec's or the default limits.
        changes: overrides for experiment, inputs and parameters.
        record: variables to record before those of the spec and the formula: requirements that are searched
            together record the same.
        context: files that a language model may read beside those that the spec names; ``fmu``: also what
            lies inside the FMU; ``none``: not what the spec names; ``checked:FILE``: a line of this file
            looks like a key and is none.
    """

    target: Recordable
    stl: str | None = None
    stl_name: str = STL_NAME
    profile: str | None = None
    parameterization: Parameterization = "free"
    shortest_piece: Number | None = None
    changes: ModelChanges = Field(default_factory=ModelChanges)
    # Left out where it is empty, so that runs keep their names.
    record: tuple[str, ...] = Field(default=(), exclude_if=lambda names: not names)
    context: tuple[Recordable, ...] = ()

    @field_serializer("changes")
    def _stated_only(self, changes: ModelChanges) -> dict[str, Any]:
        """Leave unset fields unset when a source is read again: an explicit None would override the spec."""
        return changes.model_dump(mode="json", exclude_unset=True)

    def __hash__(self) -> int:
        return hash(self.model_dump_json())

    @property
    def parts(self) -> Target:
        """The parts of the target."""
        return Target.parse(self.target)

    @property
    def is_bundled(self) -> bool:
        """Whether it is a bundled requirement as it is: nothing that decides its outputs was changed."""
        parts = self.parts
        is_ours = parts.kind == "spec" and Path(parts.file).resolve().parent == bundled("specs").resolve()
        changes = self.changes.model_dump(exclude={"allow", "deny"}, exclude_defaults=True)
        return (parts.kind == "bundled" or is_ours) and not (self.stl or self.shortest_piece or changes)

    @property
    def name(self) -> str:
        """The requirement's name; the name of the file or of the bundled spec if the target states none.

        >>> ProblemSource(target="specs/AT.toml:AT1").name, ProblemSource(target="my/AT.toml").name
        ('AT1', 'AT')
        """
        parts = self.parts
        return parts.requirement or Path(parts.file).stem or self.target


def source_of(target: str | PathLike[str], **more: Any) -> ProblemSource:
    """Return the source for values that a user gave; SpecError naming the argument that is wrong."""
    try:
        return ProblemSource(target=fspath(target) if isinstance(target, PathLike) else target, **more)
    except ValidationError as error:
        raise SpecError(": ".join(first_fault(error))) from None
