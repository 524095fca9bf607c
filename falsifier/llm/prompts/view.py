"""What an LLM may know about a problem: everything except the model itself."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from falsifier.context.values import Context
from falsifier.core.model import Experiment, ModelInfo
from falsifier.core.space import SearchSpace
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl.formula import Always, Eventually, Until


@dataclass(frozen=True, slots=True)
class View:
    """A problem without its model.

    Attributes:
        info: the model's names, units and descriptions.
        requirement: the requirement to violate.
        space: search space.
        experiment: stop time and output grid.
        levels: values that something searched can take, by name, if they are levels without a type.
        tells_kinds: whether types of signals are told.
        more_decimals: decimals that the published variants tell in addition to theirs, which are those of
            signals in the hundreds.
        context: what the files say that the user named.
    """

    info: ModelInfo
    requirement: Requirement
    space: SearchSpace
    experiment: Experiment
    levels: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    tells_kinds: bool = True
    more_decimals: int = 0
    context: Context = field(default_factory=Context)

    @classmethod
    def of(cls, problem: Problem) -> "View":
        """Make the view of a problem."""
        return cls(
            problem.info,
            problem.requirement,
            problem.space,
            problem.experiment,
            context=problem.context,
        )

    def unit(self, name: str) -> str:
        """Unit of a signal; empty if unknown or dimensionless."""
        return self.info[name].unit if name in self.info else ""

    def description(self, name: str) -> str:
        """Description of a signal; empty if it has none."""
        return self.info[name].description if name in self.info else ""

    def kind(self, name: str) -> str:
        """Type of a signal's values; real if unknown."""
        return self.info.kind(name)

    def items(self, name: str) -> tuple[str, ...]:
        """Numbers of an enumeration with the names of its items; empty if it has none."""
        literals = self.info[name].literals if name in self.info else {}
        return tuple(f"{number} = {item}" for item, number in literals.items())

    def labelled(self, name: str, value: float, text: str) -> str:
        """A value's text, with the name of its item if it has one."""
        literals = self.info[name].literals if name in self.info else {}
        item = next((item for item, number in literals.items() if number == value), "")
        return f"{text} ({item})" if item else text

    @property
    def chosen(self) -> str:
        """What is chosen, in one word."""
        return "inputs" if self.space.inputs else "parameters"

    @property
    def looked_at(self) -> float:
        """Time in s up to which the requirement looks; the stop time if it is about as late."""
        formula, stop_time = self.requirement.formula, self.space.stop_time
        timed = [f for f in formula.walk() if isinstance(f, Always | Eventually | Until)]
        if any(f.window is None for f in timed):
            return stop_time
        horizon = formula.horizon(self.experiment.output_interval)
        return horizon if horizon < stop_time - self.experiment.output_interval else stop_time

    @property
    def formula_outputs(self) -> tuple[str, ...]:
        """Signals of the formula that are not searched inputs, in order of appearance."""
        return tuple(n for n in self.requirement.formula.signals if n not in self.space.names)
