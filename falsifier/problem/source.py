"""Where a problem comes from, as one value: enough to load it again."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_serializer

from falsifier.problem.spec import ModelChanges

Parameterization = Literal["free", "fixed"]


class ProblemSource(BaseModel):
    """A spec's requirement, or an FMU with a formula, and changes to either.

    Attributes:
        target: ``file.toml:REQ``, ``file.fmu``, a bundled name such as ``AT1``, or ``python:MODULE:NAME``: a
            Problem made in Python, or a function that returns one.
        stl: formula to judge instead of the spec's requirement.
        profile: another parameterization that the spec offers.
        parameterization: ``fixed``: only the spec's own control points.
        changes: override what spec or FMU say of the experiment, inputs and parameters.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    target: str
    stl: str | None = None
    profile: str | None = None
    parameterization: Parameterization = "free"
    changes: ModelChanges = Field(default_factory=ModelChanges)

    @field_serializer("changes")
    def _stated_only(self, changes: ModelChanges) -> dict[str, Any]:
        """What is not stated stays so when a source is read again: a None would override the spec."""
        return changes.model_dump(mode="json", exclude_unset=True)

    def __hash__(self) -> int:
        return hash(self.model_dump_json())

    @property
    def name(self) -> str:
        """The target's last part: the requirement's name where the target has one.

        >>> ProblemSource(target="specs/AT.toml:AT1").name, ProblemSource(target="AT1").name
        ('AT1', 'AT1')
        """
        return self.target.rpartition(":")[2]
