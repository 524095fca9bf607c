"""The unit of work: a model, a requirement, and what may be varied."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from falsifier.model import Experiment, Model, ModelInfo
from falsifier.space import SearchSpace
from falsifier.stl import Formula


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
    """Everything that evaluate and a proposer need to know; immutable and picklable.

    Attributes:
        model: what simulates.
        requirement: what must hold.
        space: what may be varied.
        experiment: how each simulation is run.
        parameters: fixed parameter and start values by name.
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
