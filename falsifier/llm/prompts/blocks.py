"""A prompt as a value: typed blocks, each present or absent (None) according to the variant."""

from pydantic import BaseModel, ConfigDict, Field

from falsifier.core.signals import Interpolation


class _Block(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class TaskBlock(_Block):
    """The task."""

    knows_requirement: bool
    is_published: bool = Field(default=False, description="Told as the published prompts tell it.")
    chosen: str = Field(default="inputs", description="What is chosen: inputs, or parameters alone.")
    count: int = Field(description="Number of candidates wanted.")


class SystemBlock(_Block):
    """The simulated system."""

    name: str
    description: str


class RequirementBlock(_Block):
    """The requirement to violate."""

    formula: str
    reading: str = Field(default="", description="The formula in plain words.")
    description: str = ""
    terms: tuple[str, ...] = Field(
        default=(), description="Compared expressions that are more than a single signal."
    )


class SignalLine(_Block):
    """One recorded signal."""

    name: str
    unit: str = ""
    description: str = ""
    kind: str = "real"
    items: tuple[str, ...] = Field(default=(), description="Numbers and names of an enumeration.")
    start: str = Field(default="", description="Its value at time 0.")
    known: tuple[str, ...] = Field(default=(), description="What the context files say of it.")


class OutputsBlock(_Block):
    """Signals that are recorded."""

    signals: tuple[SignalLine, ...]
    legend: str = Field(default="", description="How signals over time are written.")


class DimensionLine(_Block):
    """One number to choose."""

    number: int
    meaning: str = Field(default="", description="Such as 'throttle [%] at t = 8.33 s'; empty: not revealed.")
    low: str
    high: str


class InputLine(_Block):
    """One input signal to choose."""

    name: str
    unit: str = ""
    description: str = ""
    kind: str = "real"
    items: tuple[str, ...] = Field(default=(), description="Numbers and names of an enumeration.")
    low: str
    high: str
    control_points: int
    times: tuple[str, ...]
    every: str = Field(default="", description="Distance of evenly spaced times in s; empty: see times.")
    interpolation: Interpolation
    hold: float | None = None
    max_control_points: int | None = Field(default=None, description="None: the control points are fixed.")
    min_interval: float | None = None
    known: tuple[str, ...] = Field(default=(), description="What the context files say of it.")


class ParameterLine(_Block):
    """One parameter or initial state to choose."""

    name: str
    unit: str = ""
    description: str = ""
    kind: str = "real"
    items: tuple[str, ...] = Field(default=(), description="Numbers and names of an enumeration.")
    low: str
    high: str
    nominal: str = ""
    known: tuple[str, ...] = Field(default=(), description="What the context files say of it.")


class ExcerptLines(_Block):
    """What is told of one file."""

    name: str
    form: str
    text: str


class ContextBlock(_Block):
    """What the files say that the user named."""

    comparisons: tuple[str, ...] = Field(
        default=(), description="Comparisons of variables that are not among the signals."
    )
    files: tuple[ExcerptLines, ...]


class CourseLine(_Block):
    """What one input signal does between its control points."""

    name: str
    interpolation: Interpolation
    hold: float | None = None
    is_constant: bool = Field(default=False, description="It has only one control point.")


class InputsBlock(_Block):
    """Everything to choose."""

    stop_time: str = Field(default="", description="Empty: not told.")
    horizon: str = Field(default="", description="Time up to which the requirement looks, if it is earlier.")
    dimensions: tuple[DimensionLine, ...] = ()
    courses: tuple[CourseLine, ...] = Field(default=(), description="Of the dimensions that are signals.")
    inputs: tuple[InputLine, ...] = ()
    parameters: tuple[ParameterLine, ...] = ()


class SampleLines(_Block):
    """One earlier sample."""

    number: int
    mark: str = Field(default="", description="Why an old sample is shown: 'best so far', ...")
    weight: int = Field(default=0, description="Those with smaller weights are shortened first.")
    inputs: tuple[str, ...]
    robustness: str = Field(default="", description="Empty if there is no verdict.")
    doubt: str = Field(default="", description="Why a violation does not count.")
    failure: str = ""
    facts: tuple[str, ...] = Field(default=(), description="Observations, one line each.")
    details: tuple[str, ...] = Field(
        default=(), description="Further observations; removed first if the prompt is too long."
    )


class HistoryBlock(_Block):
    """Earlier samples in the order in which they were simulated."""

    samples: tuple[SampleLines, ...]
    omitted: int = 0
    pending: tuple[str, ...] = Field(default=(), description="Candidates without a result yet.")
    notes: tuple[str, ...] = ()


class BudgetBlock(_Block):
    """Simulations of the run."""

    used: int
    limit: int


class AdviceBlock(_Block):
    """How to use the rest of the prompt."""

    lines: tuple[str, ...]
    on_samples: tuple[str, ...] = Field(default=(), description="Told once there are samples.")


class ReplyBlock(_Block):
    """The required form of the reply."""

    example: str = Field(default="", description="Empty: numbers between tags are asked for.")
    order: str = Field(default="", description="Order of the numbers between tags.")
    has_numbers: bool = Field(default=True, description="Whether the example contains numbers.")
    notes: tuple[str, ...] = ()


class Prompt(_Block):
    """The complete content of one request."""

    variant: str
    task: TaskBlock
    system: SystemBlock | None = None
    requirement: RequirementBlock | None = None
    outputs: OutputsBlock | None = None
    inputs: InputsBlock
    history: HistoryBlock | None = None
    context: ContextBlock | None = None
    budget: BudgetBlock | None = None
    advice: AdviceBlock | None = None
    reply: ReplyBlock
