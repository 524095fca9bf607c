"""The sections of a spec file."""

from collections.abc import Mapping
from contextlib import suppress
from math import isfinite
from numbers import Real
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, BeforeValidator, Field, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from falsifier.core.arguments import utf_8
from falsifier.core.model import Interface
from falsifier.core.ranges import Scale
from falsifier.core.signals import Interpolation
from falsifier.core.strict import Strict
from falsifier.errors import did_you_mean, shown, written
from falsifier.fmu.process.network import Extrapolation, Isolation, Loops, Method


def no_truth(value: Any) -> Any:
    """Refuse a truth value, which pydantic would take for 0 or 1."""
    if isinstance(value, bool):
        raise ValueError(f"expected a number, got {shown(value)}")
    return value


def _plain(value: Any) -> Any:
    if isinstance(value, str):  # pydantic would take "5" for 5
        raise ValueError(f"expected a number, got {shown(value)}")
    return no_truth(value)


def _number_or_word(value: Any) -> float | str:
    """Truth values are words like names of items: the variable knows the numbers that they stand for."""
    if isinstance(value, bool | str):
        return value if isinstance(value, str) else shown(value)
    is_number = isinstance(value, Real)
    with suppress(OverflowError):  # of an integer
        if is_number and isfinite(value):
            return float(value)
    kind = "a finite number" if is_number else "a number or text"
    raise ValueError(f"expected {kind}, got {shown(value)}")


# A path, or a text with one: all that users name is recorded.
Recordable = Annotated[str, AfterValidator(utf_8)]
# Limits come first: after a validator, a JSON Schema does not state them.
Number = Annotated[float, Field(allow_inf_nan=False), BeforeValidator(_plain)]
Value = Annotated[float | str, BeforeValidator(_number_or_word)]
Seconds = Annotated[float, Field(gt=0, allow_inf_nan=False), BeforeValidator(_plain)]
Duration = Annotated[float, Field(ge=0, allow_inf_nan=False), BeforeValidator(_plain)]
Truth = Annotated[bool, Field(strict=True)]
Count = Annotated[int, BeforeValidator(_plain)]
# Maximum number of control points of one input.
MAX_CONTROL_POINTS = 10_000
_ControlPoints = Annotated[int, Field(ge=1, le=MAX_CONTROL_POINTS), BeforeValidator(_plain)]


def in_order(limits: tuple[float, float]) -> tuple[float, float]:
    """Return the ends of a range; ValueError if the first one is not the smaller one."""
    if not limits[0] < limits[1]:
        constant = written("; --set NAME=VALUE keeps it constant", "; one number alone keeps it constant")
        raise ValueError(
            f"expected [low, high] with low < high, got [{limits[0]:.12g}, {limits[1]:.12g}]"
            f"{constant if limits[0] == limits[1] else ''}"
        )
    return limits


Range = Annotated[tuple[Number, Number], AfterValidator(in_order)]
# Of a variable, whose items' names stand for numbers that are known once there is a model.
Ends = Annotated[tuple[Value, Value], AfterValidator(lambda e: e if str in map(type, e) else in_order(e))]


class Section(Strict):
    """A section of a spec file, which says what is wrong with its keys."""

    # Keys that make another section of it.
    other_keys: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="before")
    @classmethod
    def _has_known_keys(cls, section: Any) -> Any:
        """Say which keys there are, and what a missing one means; ``wrong_key`` states the key beside it."""
        if not isinstance(section, Mapping):
            return section
        own_first = sorted(cls.model_fields.items(), key=lambda named: named[0] not in cls.__annotations__)
        fields = {field.alias or name: field for name, field in own_first}
        for key in section:
            if key not in fields:
                raise _wrong(str(key), f"unknown key; {did_you_mean(str(key), (*fields, *cls.other_keys))}")
        for key, field in fields.items():
            if field.is_required() and key not in section:
                raise _wrong(key, missing(field))
        return section


def missing(field: FieldInfo) -> str:
    """Say that a key is missing, and what it means."""
    return f"this key is missing: {(field.description or '').removesuffix('.')}"


def _wrong(key: str, message: str) -> PydanticCustomError:
    return PydanticCustomError("wrong_key", "{message}", {"key": key, "message": message})


class FreeSection(Section):
    """Limits of a free parameterization."""

    max_control_points: _ControlPoints = Field(description="Maximum number of control points.")
    min_interval: Seconds = Field(description="Minimum time between two control points in s.")


class InputSection(Section):
    """One input signal: searched within a range, or kept constant."""

    range: Ends | None = Field(
        None, description="[low, high], numbers or names of items; default: the FMU's min and max."
    )
    control_points: _ControlPoints | None = Field(
        None, description="Number of evenly spaced control points; default: engines choose them, 5 if fixed."
    )
    interpolation: Interpolation | None = Field(
        None,
        description="pchip (default), linear or constant; integers, Booleans, enumerations: constant only.",
    )
    hold: Seconds | None = Field(None, description="Sample-and-hold period in s.")
    free: FreeSection | None = Field(
        None, description="Limits within which engines may choose the control points."
    )
    value: Value | None = Field(
        None, description="Keep this input constant: a number, or the name of an enumeration's item."
    )

    @model_validator(mode="after")
    def _searched_or_fixed(self) -> "InputSection":
        if self.value is not None and (self.range is not None or self.control_points is not None):
            raise ValueError("value keeps the input constant; remove it, or remove range and control_points")
        return self

    @property
    def is_open(self) -> bool:
        """Whether it is searched, and nobody stated its parameterization."""
        return all(each is None for each in (self.value, self.control_points, self.interpolation, self.free))


class ParameterSection(Section):
    """One parameter or initial state: searched within a range, or fixed to a value."""

    range: Ends | None = Field(
        None, description="[low, high], numbers or names of items, to search; default: FMU's min and max."
    )
    scale: Scale | None = Field(
        None, description="log: search the range evenly in decades, low must be above 0; default: linear."
    )
    value: Value | None = Field(
        None,
        description="Fixed value: a number, the name of an enumeration's item, or the text of a string. A "
        "file is named relative to the spec file.",
    )

    @model_validator(mode="after")
    def _searched_or_fixed(self) -> "ParameterSection":
        if self.value is not None and (self.range is not None or self.scale is not None):
            searching = "scale is how to search it" if self.range is None else "range searches it"
            raise ValueError(f"value fixes the parameter, {searching}; remove one of them")
        return self


Inputs = dict[str, InputSection]
_BARE = BeforeValidator(lambda found: {"value": found} if isinstance(found, int | float | str) else found)
Parameters = dict[str, Annotated[ParameterSection, _BARE]]


class Simulation(Section):
    """How a model is simulated: keys of [model], which requirements and profiles may override."""

    interface: Interface | None = Field(None, description="Required if the FMU offers both.")
    stop_time: Seconds | None = Field(None, description="End of each simulation in s.")
    output_interval: Seconds | None = Field(None, description="Step of the monitored time grid in s.")
    step_size: Seconds | None = Field(None, description="Communication or maximum solver step in s.")
    tolerance: Seconds | None = Field(None, description="Relative tolerance of the solver.")
    time_limit: Seconds | None = Field(
        None,
        description="Maximum wall-clock time of one simulation in s; default: 60 per tenth of its stop time.",
    )
    logging: Truth | None = Field(None, description="Ask the FMU for its messages in every simulation.")
    omit: tuple[str, ...] = Field(
        (), description="Outputs and internal variables not to record, such as one that becomes NaN."
    )
    allow: tuple[Recordable, ...] = Field(
        (),
        description="What the FMU may do beyond changing its own folders: write:PATH, read:PATH (a file or "
        "folder that may hold keys), programs (execute programs).",
    )
    deny: tuple[str, ...] = Field((), description="What it may not do: network (open connections).")


class ModelSection(Simulation):
    """What is simulated and how."""

    fmu: Recordable | None = Field(
        None,
        description="Path of the FMU or SSP package, relative to the spec file; or see [components.NAME]",
    )
    record: tuple[str, ...] = Field((), description="Variables to record in addition to the outputs.")


class ComponentSection(Section):
    """One FMU of a system."""

    fmu: Recordable = Field(description="Path of the FMU, relative to the spec file.")
    step: Seconds | None = Field(
        None, description="Its own step in s, an integer multiple of the communication step."
    )
    interface: Interface | None = Field(
        None, description="co-simulation or model-exchange; default: co-simulation if the FMU offers it."
    )


class ConnectionSection(Section):
    """Where the values of one input of a component come from."""

    source: str = Field(alias="from", description="Output, as COMPONENT.VARIABLE.")
    factor: Number | None = Field(None, description="Factor of factor * value + offset, in place of units.")
    offset: Number | None = Field(None, description="Offset of factor * value + offset, in place of units.")
    extrapolation: Extrapolation | None = Field(
        None, description="hold or linear; default: that of [coupling]."
    )


class CouplingSection(Section):
    """How the components of a system exchange values."""

    method: Method = Field(
        "gauss-seidel",
        description="gauss-seidel: later components get the new values of earlier ones; jacobi: all step "
        "from the values of the same communication point.",
    )
    loops: Loops = Field(
        "refuse",
        description="If outputs and inputs depend directly on each other: refuse the system; delay the "
        "connection that closes the loop by one communication step; or iterate: repeat the steps in the loop "
        "until its outputs no longer change.",
    )
    extrapolation: Extrapolation = Field(
        "hold", description="Inputs during a step: hold the last value, or follow the last two linearly."
    )
    tolerance: Seconds = Field(
        1e-9,
        description="Change of an output, relative above 1, below which an initialisation or an iteration "
        "has converged.",
    )
    max_rounds: Count = Field(
        100, ge=2, description="Maximum number of rounds of an initialisation, and of an iterated step."
    )
    isolation: Isolation = Field(
        "together",
        description="together: all components run in one process; each: each in a process of its own, "
        "for libraries that cannot be loaded into one process.",
    )


class ContextSection(Section):
    """What a language model, and the engine surrogate, may read about the model; nothing else is sent."""

    files: tuple[Recordable, ...] = Field(
        (), description="Simulink files, sources and documents, relative to the spec file."
    )
    fmu: Truth = Field(default=False, description="Also documentation, sources and texts inside the FMU.")
    checked: tuple[str, ...] = Field(
        (), description="Of these files, those with a line that looks like a key or password but is not."
    )


Components = dict[str, ComponentSection]
_BARE_SOURCE = BeforeValidator(lambda found: {"from": found} if isinstance(found, str) else found)
Connections = dict[str, Annotated[ConnectionSection, _BARE_SOURCE]]


class ModelChanges(Simulation):
    """What a requirement or a profile may override."""

    inputs: Inputs = Field(default_factory=dict)
    parameters: Parameters = Field(default_factory=dict)

    @property
    def variables(self) -> list[tuple[str, InputSection | ParameterSection]]:
        """The sections of inputs and parameters, by name."""
        return [*self.inputs.items(), *self.parameters.items()]


class RequirementSection(ModelChanges):
    """One requirement, and what it overrides."""

    other_keys = ("template",)

    formula: str = Field(description="Formula in Signal Temporal Logic; or a template with its arguments.")
    description: str = Field("", description="Its meaning in words.")

    def expanded(self, stop_time: float, step: float = 0.0) -> str:
        """Return the formula, which is the same for every simulation."""
        del stop_time, step
        return self.formula


class ProfileSection(ModelChanges):
    """An alternative parameterization of the spec's problems."""

    description: str = Field("", description="What it is for.")
    requirements: dict[str, ModelChanges] = Field(
        default_factory=dict, description="What it changes for individual requirements, by name."
    )
