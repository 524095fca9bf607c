"""The unit of work: a model, a requirement, and what may be varied."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce

from falsifier.core.model import Experiment, Model, ModelInfo
from falsifier.core.space import SearchSpace
from falsifier.stl import Formula
from falsifier.stl.formula import And


@dataclass(frozen=True, slots=True)
class Requirement:
    """A named STL formula over the model's signals.

    Attributes:
        name: as the spec names it, e.g. ``AT1``.
        formula: the parsed formula; ``str(formula)`` is its text.
        description: what it means, in words.
    """

    name: str
    formula: Formula
    description: str = ""


@dataclass(frozen=True, slots=True)
class Problem:
    """Everything that evaluate and an engine need to know; immutable and picklable.

    Attributes:
        model: what simulates.
        requirement: what must hold.
        space: what may be varied.
        experiment: how each simulation is run.
        parameters: fixed values of parameters, start values and constant inputs by name.
        source: where it was loaded from, for people; empty when made in Python.
    """

    model: Model
    requirement: Requirement
    space: SearchSpace
    experiment: Experiment
    parameters: Mapping[str, float] = field(default_factory=dict)
    source: str = ""

    @property
    def info(self) -> ModelInfo:
        """What is known of the model."""
        return self.model.info

    @property
    def name(self) -> str:
        """The requirement's name."""
        return self.requirement.name


def alike(problems: Iterable[Problem]) -> list[list[Problem]]:
    """Group problems that differ in nothing but their requirement; all of a group record the same signals."""
    groups: dict[str, list[Problem]] = {}
    for problem in problems:
        bare = replace(problem.experiment, outputs=())
        key = repr((problem.model, problem.space, bare, sorted(problem.parameters.items())))
        groups.setdefault(key, []).append(problem)
    return [_recording_alike(group) for group in groups.values()]


def conjunction(problems: Sequence[Problem]) -> Problem:
    """Return the problem of which the requirement is that all of these hold."""
    if len(problems) == 1:
        return problems[0]
    formula = reduce(And, (p.requirement.formula for p in problems))
    names = ", ".join(p.name for p in problems)
    return replace(problems[0], requirement=Requirement(names, formula, "All of these together."))


def _recording_alike(group: list[Problem]) -> list[Problem]:
    outputs = tuple(dict.fromkeys(name for p in group for name in p.experiment.outputs))
    return [replace(p, experiment=replace(p.experiment, outputs=outputs)) for p in group]
