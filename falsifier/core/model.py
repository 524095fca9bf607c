"""Models: the Model protocol, and the description of a model."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from falsifier.core.arguments import one_of
from falsifier.core.experiment import Experiment
from falsifier.core.ranges import ValueKind
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.errors import OutputError, did_you_mean

Kind = Literal[ValueKind, "string"]
Causality = Literal["input", "output", "parameter", "calculatedParameter", "local", "independent"]
Interface = Literal["co-simulation", "model-exchange"]

# What descriptions of FMUs and of systems, and fmpy, call the interfaces.
INTERFACE_TAGS: Mapping[Interface, str] = {"co-simulation": "CoSimulation", "model-exchange": "ModelExchange"}
# Smallest and largest number by type name; Integer (FMI 1 and 2) has 32 bits.
_TYPE_LIMITS: Mapping[str, tuple[int, int]] = {
    "Boolean": (0, 1),
    "Integer": (-(2**31), 2**31 - 1),
    **{f"Int{b}": (-(2 ** (b - 1)), 2 ** (b - 1) - 1) for b in (8, 16, 32, 64)},
    **{f"UInt{b}": (0, 2**b - 1) for b in (8, 16, 32, 64)},
    "Float32": (2**104 - 2**128, 2**128 - 2**104),
}
# The largest integer that no other one becomes as a double.
_EXACT = 2**53 - 1
# Maximum number of internal states, and of internal modes, that searches record; beginnings of the names that
# tools give to what they add.
_MOST_INTERNALS = 12
_OF_TOOLS = ("$", "_")


@dataclass(frozen=True, slots=True)
class Variable:
    """One scalar variable of a model; each element of an array is a separate variable (``x[1]``).

    Attributes:
        name: its name in formulas and spec files.
        kind: type of its values.
        causality: role in the model.
        variability: ``constant``, ``fixed``, ``tunable``, ``discrete`` or ``continuous``.
        unit: unit of all numbers here, empty if unknown.
        display_unit: unit in which the model's author wants values displayed, empty if none is given.
        low: smallest value, None if unbounded.
        high: largest value, None if unbounded.
        nominal: typical magnitude.
        start: start value.
        settable: whether it can be set before the simulation starts.
        refusal: why it cannot be set; empty if it can, or nobody says so.
        is_state: whether it is a continuous state.
        literals: numbers of an enumeration's items by name.
        description: its meaning, from the model.
        type: name of its data type, such as ``Int8``; empty if unknown.
        alias_of: the name to use instead, if the model has one variable for both; such a name can be read.
        is_clocked: whether it belongs to clocks that never tick, so that it keeps its start value.
        is_relative: whether it is a difference, which offsets of units do not move, as of temperatures.

    Raises:
        SpecError: if the kind or the causality is not one of those that there are.
    """

    name: str
    kind: Kind = "real"
    causality: Causality = "local"
    variability: str = "continuous"
    unit: str = ""
    display_unit: str = ""
    low: float | None = None
    high: float | None = None
    nominal: float | None = None
    start: float | str | None = None
    settable: bool = False
    refusal: str = ""
    is_state: bool = False
    literals: Mapping[str, int] = field(default_factory=dict)
    description: str = ""
    type: str = ""
    alias_of: str = ""
    is_clocked: bool = False
    is_relative: bool = False

    def __post_init__(self) -> None:
        one_of("kind of a variable", self.kind, get_args(Kind))
        one_of("causality of a variable", self.causality, get_args(Causality))

    @property
    def start_number(self) -> float | None:
        """Start value as a number; None if there is none, or it is a text."""
        return None if isinstance(self.start, str | None) else float(self.start)

    @property
    def is_bounded(self) -> bool:
        """Whether both ends of its range are known."""
        return None not in self.limits

    @property
    def is_continuous(self) -> bool:
        """Whether it may change at any time, and not only at events."""
        return self.kind == "real" and self.variability == "continuous"

    @property
    def type_limits(self) -> tuple[int, int] | None:
        """Smallest and largest number of its data type; None for doubles and unknown types."""
        return _TYPE_LIMITS.get(self.type)

    @property
    def limits(self) -> tuple[float | None, float | None]:
        """Declared min and max; if none is declared, those of a Boolean or of an enumeration's items."""
        numbers = (0, 1) if self.kind == "boolean" else tuple(self.literals.values())
        low = min(numbers, default=None) if self.low is None else self.low
        high = max(numbers, default=None) if self.high is None else self.high
        return low, high

    @property
    def items(self) -> tuple[tuple[str, int], ...]:
        """Names and numbers of an enumeration's items, as ranges have them; empty for other types."""
        return tuple(self.literals.items())

    @property
    def items_text(self) -> str:
        """Numbers and names of an enumeration's items; empty for other types."""
        return ", ".join(f"{number} = {name}" for name, number in self.literals.items())

    def number_of(self, word: str) -> float | None:
        """Return the number that an item's name, or ``true`` or ``false``, stands for; None for others."""
        if self.kind == "boolean":
            return {"false": 0.0, "true": 1.0}.get(word.lower())
        return float(self.literals[word]) if word in self.literals else None

    @property
    def or_name(self) -> str:
        """What can be given in place of a number, in words; empty if nothing can."""
        names = ("true", "false") if self.kind == "boolean" else self.literals
        return f" or one of {', '.join(names)}" if names else ""

    def expected(self, value: float) -> str:
        """Say what is expected instead of a value that the type does not have; empty if it has it."""
        numbers = self.literals.values() or ((0, 1) if self.kind == "boolean" else (value // 1,))
        least, most = self.type_limits or (-_EXACT, _EXACT)
        least, most = max(least, -_EXACT), min(most, _EXACT)
        if self.kind == "real" or (value in numbers and least <= value <= most):
            return ""
        size = "" if least <= value <= most else f" from {least} to {most}"
        size += " (larger doubles are not exact)" if size and most == _EXACT else ""
        whole = "0 or 1" if self.kind == "boolean" else f"an integer{size}"
        return f"expected {f'one of {self.items_text}' if self.literals else whole} for {self.name!r}"

    def excess(self, low: float, high: float) -> str:
        """Say which limits a range, or a single value, exceeds; empty if none."""
        numbers, is_integer = self.literals.values(), self.kind == "integer"
        for what, (least, most) in (
            ("the integers that doubles tell apart, for", (-_EXACT, _EXACT) if is_integer else (None, None)),
            (f"the range of the type {self.type} of", self.type_limits or (None, None)),
            (f"the items ({self.items_text}) of", (min(numbers), max(numbers)) if numbers else (None, None)),
            ("the model's limits for", self.limits),
        ):
            if (least is not None and low < least) or (most is not None and high > most):
                limits = ", ".join(
                    "no limit" if limit is None else f"{limit:.16g}" for limit in (least, most)
                )
                return f"exceeds {what} {self.name!r}, [{limits}]"
        return ""


@dataclass(frozen=True, slots=True)
class ModelInfo:
    """What is known about a model without simulating it.

    Attributes:
        name: the model's name.
        description: a sentence or two about the system.
        fmi_version: ``1.0``, ``2.0``, ``3.0``; empty for models that are not FMUs.
        interfaces: how it can be simulated.
        platforms: names of the platforms for which it contains binaries.
        tool: the tool that generated it.
        start_time: start time of its default experiment in s, if given; simulations start at 0.
        stop_time: stop time of its default experiment in s, if given.
        step_size: step size of its default experiment in s, if given.
        internal_step: step in s of its own solver, if given (FMI 3); its communication steps are multiples.
        tolerance: relative tolerance of its default experiment, if given.
        variables: all scalar variables.
        notes: what the user should know: what is ignored, unusual or needed, one sentence each.
        components: names of the components of a system; empty for a single model.
        connections: outputs and inputs that are connected in a system, as pairs of names.
    """

    name: str
    description: str = ""
    fmi_version: str = ""
    interfaces: tuple[Interface, ...] = ()
    platforms: tuple[str, ...] = ()
    tool: str = ""
    start_time: float | None = None
    stop_time: float | None = None
    step_size: float | None = None
    internal_step: float | None = None
    tolerance: float | None = None
    variables: tuple[Variable, ...] = ()
    notes: tuple[str, ...] = ()
    components: tuple[str, ...] = ()
    connections: tuple[tuple[str, str], ...] = ()

    @property
    def noun(self) -> str:
        """What this model is called in messages about files: system or FMU."""
        return "system" if self.components else "FMU"

    def __getitem__(self, name: str) -> Variable:
        for variable in self.variables:
            if variable.name == name:
                return variable
        raise KeyError(f"no variable {name!r}; {did_you_mean(name, (v.name for v in self.variables))}")

    def __contains__(self, name: object) -> bool:
        return any(v.name == name for v in self.variables)

    @property
    def default_interface(self) -> Interface:
        """Co-simulation if the model offers it, with its exporting tool's solver, or if it offers none."""
        return "model-exchange" if self.interfaces == ("model-exchange",) else "co-simulation"

    def kind(self, name: str) -> Kind:
        """Return the type of a variable's values; real if there is no such variable."""
        return next((v.kind for v in self.variables if v.name == name), "real")

    @property
    def starts(self) -> frozenset[str]:
        """Names of the variables of which only where they start can be given; the model computes them."""
        return frozenset(v.name for v in self.variables if v.causality not in ("input", "parameter"))

    def with_causality(self, causality: Causality) -> tuple[Variable, ...]:
        """Return the variables with this causality, in the model's order, except those of ignored clocks."""
        return tuple(v for v in self.variables if v.causality == causality and not v.is_clocked)

    @property
    def inputs(self) -> tuple[Variable, ...]:
        """Input variables in the model's order; of several names for one input, the first."""
        return tuple(v for v in self.with_causality("input") if not v.alias_of)

    @property
    def outputs(self) -> tuple[Variable, ...]:
        """Output variables in the model's order."""
        return self.with_causality("output")

    @property
    def observables(self) -> tuple[Variable, ...]:
        """Variables to write requirements about: the outputs; without any, the states or the locals."""
        states = tuple(v for v in self.variables if v.is_state)
        computed = (v for v in self.with_causality("local") if v.variability in ("continuous", "discrete"))
        return self.outputs or states or tuple(computed)

    @property
    def internals(self) -> tuple[Variable, ...]:
        """Its first states and modes (integers, Booleans, enumerations), which outputs may hide."""
        connected = {target for _, target in self.connections}
        local = [v for v in self.with_causality("local") if not v.alias_of and v.name not in connected]
        known = [v for v in local if not any(part.startswith(_OF_TOOLS) for part in v.name.split("."))]
        states = [v for v in known if v.is_state]
        modes = [v for v in known if v.variability == "discrete" and v.kind not in ("real", "string")]
        return (*states[:_MOST_INTERNALS], *modes[:_MOST_INTERNALS])

    @property
    def parameters(self) -> tuple[Variable, ...]:
        """Parameters in the model's order; of several names for one parameter, the first."""
        return tuple(v for v in self.with_causality("parameter") if not v.alias_of)


class Model(Protocol):
    """Something that simulates. Models are picklable descriptions; what they load stays in its process."""

    @property
    def info(self) -> ModelInfo:
        """What is known about the model without simulating it."""
        ...

    def simulate(
        self, signals: Mapping[str, Signal], parameters: Mapping[str, float], experiment: Experiment
    ) -> Trajectory:
        """Simulate once from time 0 and return the outputs on the experiment's time grid.

        Args:
            signals: input signals by name; inputs without one keep their start values.
            parameters: values of parameters and start values, by name.
            experiment: times, outputs and limits.

        Raises:
            SimulationError: if there is no complete trajectory of finite numbers; states the cause.
            ModelError: if the model cannot be used at all.
        """
        ...

    def close(self) -> None:
        """Release processes, libraries and folders; the next simulation opens them again."""
        ...


def check_finite(
    model: str, times: NDArray[np.float64], columns: Mapping[str, NDArray[np.float64]], *, hint: str = ""
) -> None:
    """Reject outputs with NaN or inf; OutputError naming the output and the first time of one."""
    for name, column in columns.items():
        finite = np.isfinite(column)
        if not finite.all():
            k = int(np.argmin(finite))
            raise OutputError(
                f"{model}: output {name!r} is {column[k]} at t = {times[k]:g} s{hint}", time=float(times[k])
            )
