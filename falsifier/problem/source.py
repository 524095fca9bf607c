"""Sources of problems: what is needed to load a problem again, in another process or from a journal."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_serializer

from falsifier.problem.spec import ModelChanges

Parameterization = Literal["free", "fixed"]


class ProblemSource(BaseModel):
    """A spec's requirement, or an FMU with a formula, and changes to either.

    Attributes:
        target: ``file.toml:REQ``, ``file.fmu``, a bundled name such as ``AT1``, or ``python:MODULE:NAME``: a
            Problem made in Python, or a function that returns one.
        stl: formula to use instead of the spec's requirement.
        profile: name of a profile of the spec.
        parameterization: ``free``: engines may choose control points within the spec's limits; ``fixed``:
            only the control points of the spec are allowed.
        changes: overrides for experiment, inputs and parameters.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    target: str
    stl: str | None = None
    profile: str | None = None
    parameterization: Parameterization = "free"
    changes: ModelChanges = Field(default_factory=ModelChanges)

    @field_serializer("changes")
    def _stated_only(self, changes: ModelChanges) -> dict[str, Any]:
        """Leave unset fields unset when a source is read again: an explicit None would override the spec."""
        return changes.model_dump(mode="json", exclude_unset=True)

    def __hash__(self) -> int:
        return hash(self.model_dump_json())

    @property
    def name(self) -> str:
        """The last part of the target: the requirement's name, if the target contains one.

        >>> ProblemSource(target="specs/AT.toml:AT1").name, ProblemSource(target="AT1").name
        ('AT1', 'AT1')
        """
        return self.target.rpartition(":")[2]
