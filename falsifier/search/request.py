"""What a user requested, as one value: enough to run it, record it and repeat it."""

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from falsifier.core.files import below_home
from falsifier.core.literals import shell_word
from falsifier.core.secrets import holds_credentials, is_secret_option, without_credentials
from falsifier.core.strict import Strict
from falsifier.llm import Effort
from falsifier.llm.model_file import is_model_file
from falsifier.llm.providers import check_address, check_option_values, stated_address
from falsifier.problem.sections import no_truth
from falsifier.problem.source import ProblemSource
from falsifier.search.budget import Budget

_Count = Annotated[int, BeforeValidator(no_truth)]
# A negative price, or one that is not a number, would switch off the limit on the cost.
_Price = Annotated[float, Field(ge=0, allow_inf_nan=False), BeforeValidator(no_truth)]
_Seconds = Annotated[float, Field(gt=0, allow_inf_nan=False), BeforeValidator(no_truth)]

# Which trajectories a record keeps. history: the first ones, then each that improves on the best; best: only
# the best one, for campaigns of very many runs.
Keep = Literal["history", "best"]


class LLMSettings(Strict):
    """Which language model to ask, and how; what does not fit is a ``ValidationError`` of pydantic."""

    # An option that contains a key is rejected, and the error must not show it either.
    model_config = ConfigDict(hide_input_in_errors=True)

    name: str
    effort: Effort | None = None
    api_base: str | None = None
    variant: str | None = Field(default=None, description="Prompt variant; default: the best one.")
    options: dict[str, str | int | float | bool] = Field(
        default_factory=dict, description="Passed to litellm unchanged."
    )
    price: tuple[_Price, _Price] | None = Field(
        default=None,
        description="US dollars per million tokens sent, and per million received; default: litellm's table.",
    )
    timeout: _Seconds | None = Field(default=None, description="Seconds to wait for one reply; default: 600.")
    anonymous: bool = Field(default=False, description="Use neutral names in prompts.")
    cache: bool = Field(default=True, description="Answer repeated questions from disk.")

    @property
    def told(self) -> str:
        """Its name, and where its server is, if that is not the provider's own."""
        return f"{self.name} at {self.api_base}" if self.api_base else self.name

    @property
    def check(self) -> str:
        """The command that checks it, with all that decides where prompts and a key go."""
        given = [] if self.api_base is None else [f"--api-base {shell_word(self.api_base)}"]
        options = sorted(self.options.items())
        # Numbers name no place.
        given += [f"--llm-option {shell_word(f'{n}={v}')}" for n, v in options if isinstance(v, bool | str)]
        return " ".join(["falsifier llm check", shell_word(self.name), *given])

    @property
    def is_usual(self) -> bool:
        """Whether prompts go to the provider's own server, or the environment's, and nowhere else."""
        here = LLMSettings(name=self.name)
        usual = (here.check, here.model_copy(update={"api_base": None}).check)
        return self.check in usual and not is_model_file(self.name)

    @model_validator(mode="before")
    @classmethod
    def _address_of_environment(cls, given: Any, info: ValidationInfo) -> Any:
        """Take the address from the environment, without its password, unless this is read from a record.

        So a run that is continued, or repeated elsewhere, asks the same server.
        """
        is_new = info.mode == "python" and isinstance(given, dict) and given.get("api_base") is None
        if not (is_new and isinstance(name := given.get("name"), str) and name):
            return given
        address = stated_address(name, None)
        return {**given, "api_base": address and without_credentials(address)}

    @model_validator(mode="after")
    def _without_password(self) -> Self:
        check_address(self.name, self.api_base)
        return self

    @field_validator("name")
    @classmethod
    def _whole_path(cls, name: str) -> str:
        """The whole path of a model file, so that a run can be resumed from any folder."""
        return str(below_home(name).absolute()) if is_model_file(name) else name

    @field_validator("options")
    @classmethod
    def _without_keys(cls, options: dict[str, Any]) -> dict[str, Any]:
        for name in filter(is_secret_option, options):
            raise ValueError(
                f"{name}: may contain a key; keys are read from the environment only, because requests are "
                "recorded: set the provider's variable"
            )
        for name, value in options.items():
            if isinstance(value, str) and holds_credentials(value):
                raise ValueError(
                    f"{name}: contains a user name or a password, and requests are recorded; state them in "
                    "the environment"
                )
        check_option_values(options)
        return options


class RunRequest(Strict):
    """One run. Naming a language model without an engine means that it leads the search."""

    problems: tuple[ProblemSource, ...] = Field(
        description="Requirements falsified in one search; empty: the problems were made in Python."
    )
    engine: str | None = None
    llm: LLMSettings | None = None
    seed: _Count = Field(default=0, ge=0)
    budget: Budget = Budget()
    jobs: _Count = Field(default=1, ge=1)
    keep: Keep = "history"
    start_from: tuple[dict[str, Any], ...] = Field(
        default=(), description="Known candidates, simulated before those of the engine."
    )

    @property
    def source(self) -> ProblemSource | None:
        """Where the first problem comes from; None if it was made in Python."""
        return self.problems[0] if self.problems else None
