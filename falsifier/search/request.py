"""What a user asked for, as one value: enough to run it, to record it and to run it again."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from falsifier.core.secrets import is_secret_option
from falsifier.problem.source import ProblemSource
from falsifier.search.budget import Budget
from falsifier.search.journal import Keep

Effort = Literal["low", "medium", "high"]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class LLMSettings(_Strict):
    """Which language model, and how it is asked."""

    # An option that holds a key is refused, and must not stand in the error's text either.
    model_config = ConfigDict(extra="forbid", frozen=True, hide_input_in_errors=True)

    name: str
    effort: Effort | None = None
    api_base: str | None = None
    variant: str | None = Field(default=None, description="Prompt variant; default: the best one.")
    options: dict[str, str | float] = Field(
        default_factory=dict, description="Passed to litellm as they are."
    )
    price: tuple[float, float] | None = Field(
        default=None, description="US dollars for 1000 tokens sent and received; default: litellm's table."
    )
    anonymous: bool = Field(default=False, description="The LLM is told neutral names only.")
    fallback: str | None = Field(default=None, description="Engine to switch to if the LLM fails.")
    cache: bool = Field(default=True, description="Equal questions are answered from disk.")

    @field_validator("options")
    @classmethod
    def _without_keys(cls, options: dict[str, str | float]) -> dict[str, str | float]:
        for name in filter(is_secret_option, options):
            raise ValueError(f"{name}: keys are read from the environment only; requests are recorded")
        return options


class RunRequest(_Strict):
    """One run. Naming a language model without an engine means that it leads the search."""

    problems: tuple[ProblemSource, ...] = Field(
        description="Requirements that are falsified in one search; empty: problems made in Python."
    )
    engine: str | None = None
    llm: LLMSettings | None = None
    seed: int = Field(default=0, ge=0)
    budget: Budget = Budget()
    jobs: int = Field(default=1, ge=1)
    keep: Keep = "history"

    @property
    def source(self) -> ProblemSource | None:
        """Where the first problem comes from; None where it was made in Python."""
        return self.problems[0] if self.problems else None
