"""A prompt as a value: typed blocks, each of them on or off (None) as the variant says."""

from pydantic import BaseModel, ConfigDict, Field

from falsifier.core.signals import Interpolation


class _Block(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class TaskBlock(_Block):
    """What the search is for."""

    knows_requirement: bool
    count: int = Field(description="Candidates wanted.")


class SystemBlock(_Block):
    """What the model is."""

    name: str
    description: str


class RequirementBlock(_Block):
    """What must hold, and is to be violated."""

    formula: str
    reading: str = Field(default="", description="The formula in plain words.")
    description: str = ""
    terms: tuple[str, ...] = Field(default=(), description="Compared expressions beyond single signals.")


class SignalLine(_Block):
    """One recorded signal."""

    name: str
    unit: str = ""
    description: str = ""
    kind: str = "real"


class OutputsBlock(_Block):
    """Signals that can be seen."""

    signals: tuple[SignalLine, ...]


class DimensionLine(_Block):
    """One number that may be chosen."""

    number: int
    meaning: str = Field(default="", description="Such as 'throttle [%] at t = 8.33 s'; empty: not told.")
    low: str
    high: str


class InputLine(_Block):
    """One input signal that may be chosen."""

    name: str
    unit: str = ""
    description: str = ""
    kind: str = "real"
    items: tuple[str, ...] = Field(default=(), description="Numbers and names of an enumeration.")
    low: str
    high: str
    control_points: int
    times: tuple[str, ...]
    interpolation: Interpolation
    hold: float | None = None
    max_control_points: int | None = Field(default=None, description="None: the control points are fixed.")
    min_interval: float | None = None


class ParameterLine(_Block):
    """One parameter or initial state that may be chosen."""

    name: str
    unit: str = ""
    description: str = ""
    kind: str = "real"
    items: tuple[str, ...] = Field(default=(), description="Numbers and names of an enumeration.")
    low: str
    high: str
    nominal: str = ""


class InputsBlock(_Block):
    """What may be chosen."""

    stop_time: str
    dimensions: tuple[DimensionLine, ...] = ()
    inputs: tuple[InputLine, ...] = ()
    parameters: tuple[ParameterLine, ...] = ()


class SampleLines(_Block):
    """One earlier sample."""

    number: int
    mark: str = Field(default="", description="Why it is shown although it is old: 'best so far', ...")
    inputs: tuple[str, ...]
    robustness: str = Field(default="", description="Empty: there is no verdict.")
    failure: str = ""
    facts: tuple[str, ...] = Field(default=(), description="What was seen, one line each.")
    details: tuple[str, ...] = Field(
        default=(), description="More of it, the first to go when room is short."
    )


class HistoryBlock(_Block):
    """Earlier samples in the order in which they were simulated."""

    samples: tuple[SampleLines, ...]
    omitted: int = 0
    pending: tuple[str, ...] = Field(default=(), description="Proposed, result not known yet.")
    notes: tuple[str, ...] = ()


class AdviceBlock(_Block):
    """How to make use of what is told."""

    lines: tuple[str, ...]


class ReplyBlock(_Block):
    """The form of the reply."""

    example: str
    notes: tuple[str, ...] = ()


class Prompt(_Block):
    """Everything that one request tells an LLM."""

    variant: str
    task: TaskBlock
    system: SystemBlock | None = None
    requirement: RequirementBlock | None = None
    outputs: OutputsBlock | None = None
    inputs: InputsBlock
    history: HistoryBlock | None = None
    advice: AdviceBlock | None = None
    reply: ReplyBlock
