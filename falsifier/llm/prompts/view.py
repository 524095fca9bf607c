"""What an LLM may know about a problem: everything except the model itself; and what a prompt tells of that.

A prompt variant is a set of parts; nothing else differs between variants.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from falsifier.context.values import Context
from falsifier.core.experiment import Experiment
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.ranges import number_names
from falsifier.core.space import SearchSpace
from falsifier.core.trajectory import Trajectory, is_discrete
from falsifier.errors import SpecError, did_you_mean
from falsifier.llm import CONTEXT_VARIANT, DEFAULT_VARIANT
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl.expression import Expression
from falsifier.stl.formula import Temporal

# What the lines on signals that nobody asked for may have in bytes, and what each has besides its name and
# its description: fewer than 200 of them are told, so that a prompt fits whatever the FMU has.
_MOST_OF_OTHERS, _BYTES_OF_LINE = 40_000, 200
# Inputs and parameters that every reply gives; of more, those that change.
_MOST_REPEATED = 3


@dataclass(frozen=True, slots=True)
class View:
    """A problem without its model, but with its names, and with what the files say that the user named."""

    info: ModelInfo
    requirement: Requirement
    space: SearchSpace
    experiment: Experiment
    context: Context = field(default_factory=Context)
    is_named: bool = True  # whether names and descriptions are those of the model

    @classmethod
    def of(cls, problem: Problem) -> "View":
        """Make the view of a problem."""
        return cls(problem.info, problem.requirement, problem.space, problem.experiment, problem.context)

    def variable(self, name: str) -> Variable:
        """What the model says of a signal; of an unknown one, that it is real and no more."""
        return self.info[name] if name in self.info else Variable(name)

    def is_discrete(self, name: str, column: NDArray[np.float64]) -> bool:
        """Whether a signal is told by its changes; the column, shape (n,), decides if it is of type real."""
        return is_discrete(column, kind=self.variable(name).kind)

    def discrete(self, trajectory: Trajectory) -> dict[str, NDArray[np.float64]]:
        """Columns of the recorded signals that are told by their changes."""
        columns = {name: trajectory[name] for name in self.recorded if name in trajectory.columns}
        return {name: column for name, column in columns.items() if self.is_discrete(name, column)}

    def labelled(self, name: str, value: float, text: str) -> str:
        """A value's text, with the name of its item if it has one."""
        literals = self.variable(name).literals
        item = next((item for item, number in literals.items() if number == value), "")
        return f"{text} ({item})" if item else text

    @property
    def chosen(self) -> str:
        """What is chosen, in one word."""
        return "inputs" if self.space.inputs else "parameters"

    @property
    def is_long_to_repeat(self) -> bool:
        """Whether so much is chosen that a reply may name a sample for what stays as it was there."""
        return len(self.space.names) > _MOST_REPEATED

    @property
    def looked_at(self) -> float:
        """Time in s up to which the requirement looks; the stop time if it is about as late."""
        formula, stop_time = self.requirement.formula, self.space.stop_time
        if any(isinstance(f, Temporal) and f.window is None for f in formula.walk()):
            return stop_time
        horizon = formula.horizon(self.experiment.output_interval)
        return horizon if horizon < stop_time - self.experiment.output_interval else stop_time

    def inside(self, trajectory: Trajectory) -> Trajectory:
        """The part of a trajectory at which the requirement looks."""
        end = int(np.searchsorted(trajectory.times, self.looked_at + trajectory.step / 2))
        return Trajectory(trajectory.times[:end], {n: c[:end] for n, c in trajectory.columns.items()})

    @property
    def formula_outputs(self) -> tuple[str, ...]:
        """Signals of the formula that are not searched themselves, in order of appearance."""
        signals, searched = self.requirement.formula.signals, self.space.names
        return tuple(n for n in signals if n not in searched or n in self.info.starts)

    @property
    def compared(self) -> dict[str, Expression]:
        """What the predicates compare, by its text."""
        return {str(side): side for p in self.requirement.formula.predicates for side in p.sides}

    @property
    def recorded(self) -> tuple[str, ...]:
        """Signals that are told over time, those of the formula first.

        What a spec records although it is no output, and what the files say something of, is always told; of
        all other outputs as many as fit.
        """
        outputs, known = self.experiment.outputs, {v.name: v for v in self.info.variables}
        described = {n: known.get(n) or Variable(n) for n in outputs}
        wanted = (n for n, v in described.items() if v.causality != "output" or self.context.of(n))
        asked = {*self.formula_outputs, *wanted}
        others = [n for n in outputs if n not in asked]
        texts = (f"{n}{described[n].description}".encode() for n in others)
        sizes = np.cumsum([_BYTES_OF_LINE + len(text) for text in texts])
        asked.update(others[: int(np.searchsorted(sizes, _MOST_OF_OTHERS, side="right"))])
        return tuple(n for n in dict.fromkeys((*self.formula_outputs, *outputs)) if n in asked)

    @property
    def counters(self) -> dict[str, dict[int, str]]:
        """Signals that may count up, with the names of their values; none where no types are told.

        Those of the requirement, or all recorded ones if none of them may.
        """
        recorded = map(self.variable, self.recorded)
        may = {
            v.name: number_names(v.kind, v.items) for v in recorded if v.kind in ("integer", "enumeration")
        }
        return {name: may[name] for name in self.formula_outputs if name in may} or may

    @property
    def untold(self) -> frozenset[str]:
        """Signals that are recorded and not told, because they are too many."""
        return frozenset(self.experiment.outputs).difference(self.recorded)


Part = Literal[
    "names",  # inputs and parameters by name and meaning; otherwise numbered dimensions
    "requirement",  # the formula
    "outputs",  # the signals of the formula
    "values",  # per sample: what the formula compares, at the control-point times
    "critical",  # per sample: critical time and signal values at that time
    "guidance",  # what to consider, as the published prompts say
    "advice",  # advice that fits the problem
    "system",  # the model's description, all recorded signals with units and descriptions
    "reading",  # the formula in plain words, its terms as derived signals
    "freedom",  # control points and interpolation may be chosen if the problem allows it
    "observations",  # per sample: all signals over time, what decided, robustness of the parts
    "history",  # all samples: what each was the first to reach, its rationale; those before it stay as told
    "lessons",  # what the language model wrote down for itself
    "circumstances",  # the budget and what is left of it, the outputs at time 0
    "failures",  # samples that could not be simulated, with the reason
    "context",  # what named files say: thresholds beside the signals, excerpts
]


@dataclass(frozen=True, slots=True)
class Variant:
    """What a prompt contains, by a name that the command line and specs take."""

    name: str
    parts: frozenset[Part]

    def has(self, part: Part) -> bool:
        """Whether the prompt contains this part."""
        return part in self.parts

    @property
    def is_published(self) -> bool:
        """Whether the variant follows a published prompt and tells nothing more."""
        return self.has("guidance")


def _variants() -> Mapping[str, Variant]:
    # MP1 to MP4 follow the published prompts, each adding to the one before; MP5 and MP6 are our own.
    # What is told at which place is compared line by line in design/published-prompts.md.
    mp1: frozenset[Part] = frozenset({"guidance"})
    mp2: frozenset[Part] = mp1 | {"names", "requirement", "outputs"}
    mp3: frozenset[Part] = mp2 | {"values"}
    mp4: frozenset[Part] = mp3 | {"critical"}
    mp6: frozenset[Part] = frozenset(get_args(Part)) - {"values", "guidance"}
    parts = {"MP1": mp1, "MP2": mp2, "MP3": mp3, "MP4": mp4, "MP5": mp6 - {"context"}, "MP6": mp6}
    return MappingProxyType({name: Variant(name, found) for name, found in parts.items()})


VARIANTS = _variants()


def variant_named(name: str | None, *, has_context: bool = False) -> Variant:
    """Variant of this name, in any case; None: the default one, or with named files the one that tells them.

    Raises:
        SpecError: for an unknown name.
    """
    default = CONTEXT_VARIANT if has_context else DEFAULT_VARIANT
    name = default if name is None else name.upper()
    if name not in VARIANTS:
        raise SpecError(f"unknown prompt variant {name!r}; {did_you_mean(name, VARIANTS)}")
    return VARIANTS[name]
