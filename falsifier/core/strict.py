"""The base of what is read from files and replies, which alone pydantic checks."""

from pydantic import BaseModel, ConfigDict


class Strict(BaseModel):
    """A value that takes no other keys than its own, and does not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)
