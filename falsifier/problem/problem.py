"""The unit of work: a model, a requirement, and what may be varied."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Self

from falsifier.core.model import Experiment, Interface, Model, ModelInfo
from falsifier.core.space import SearchSpace
from falsifier.problem.options import InputChoice, ParameterChoice, changes_from
from falsifier.problem.requirement import Requirement
from falsifier.problem.source import ProblemSource


@dataclass(frozen=True, slots=True)
class Problem:
    """Everything that evaluate and an engine need to know; immutable and picklable.

    Attributes:
        model: what simulates.
        requirement: what must hold.
        space: what may be varied.
        experiment: how each simulation is run.
        parameters: fixed values of parameters, start values and constant inputs by name.
        source: how it was loaded; None when it was made in Python, by hand or by changing a loaded one.
    """

    model: Model
    requirement: Requirement
    space: SearchSpace
    experiment: Experiment
    parameters: Mapping[str, float] = field(default_factory=dict)
    source: ProblemSource | None = None

    @classmethod
    def from_fmu(
        cls,
        fmu: str | Path,
        formula: str,
        *,
        inputs: Mapping[str, InputChoice] | None = None,
        parameters: Mapping[str, ParameterChoice] | None = None,
        stop_time: float | None = None,
        output_interval: float | None = None,
        step_size: float | None = None,
        tolerance: float | None = None,
        interface: Interface | None = None,
    ) -> Self:
        """Make the problem of an FMU and a formula.

        Args:
            fmu: path of the FMU.
            formula: the requirement, in Signal Temporal Logic.
            inputs: by name, what to search or to keep constant; see InputChoice. Nothing searched: all real
                inputs that have a min and a max.
            parameters: by name, values of parameters and start values, or ranges to search.
            stop_time: end of each simulation in s; default: the FMU's.
            output_interval: step of the monitored grid in s; default: the FMU's, or a thousandth.
            step_size: communication step or largest solver step in s; default: the output interval.
            tolerance: relative tolerance of the solver; default: the FMU's.
            interface: how the FMU is simulated; default: co-simulation where it offers that.

        Raises:
            SpecError: naming what is wrong or cannot be known.
            ModelError: when the FMU cannot be read or simulated.

        >>> Problem.from_fmu("my.fmu", "G[0,10] (h >= 0)", inputs={"u": (-1, 1)})  # doctest: +SKIP
        """
        from falsifier.problem.joining import join_fmu

        changes = changes_from(
            inputs=inputs or {},
            parameters=parameters or {},
            stop_time=stop_time,
            output_interval=output_interval,
            step_size=step_size,
            tolerance=tolerance,
            interface=interface,
        )
        joined = join_fmu(Path(fmu), formula, changes=changes)
        source = ProblemSource(target=str(fmu), stl=formula, changes=changes)
        return cls(
            joined.model, joined.requirement, joined.space, joined.experiment, joined.parameters, source
        )

    @property
    def info(self) -> ModelInfo:
        """What is known of the model."""
        return self.model.info

    @property
    def name(self) -> str:
        """The requirement's name."""
        return self.requirement.name

    @property
    def fingerprint(self) -> str:
        """SHA-256 of everything but the model's code: requirement, what is searched, how it is simulated."""
        said = (
            self.info.name,
            getattr(self.model, "interface", ""),
            self.name,
            str(self.requirement.formula),
            self.space,
            self.experiment,
            sorted(self.parameters.items()),
        )
        return sha256(repr(said).encode()).hexdigest()


def alike(problems: Iterable[Problem]) -> list[list[Problem]]:
    """Group problems that differ in nothing but their requirement; all of a group record the same signals."""
    groups: dict[str, list[Problem]] = {}
    for problem in problems:
        bare = replace(problem.experiment, outputs=())
        key = repr((problem.model, problem.space, bare, sorted(problem.parameters.items())))
        groups.setdefault(key, []).append(problem)
    return [_recording_alike(group) for group in groups.values()]


def _recording_alike(group: list[Problem]) -> list[Problem]:
    outputs = tuple(dict.fromkeys(name for p in group for name in p.experiment.outputs))
    return [replace(p, experiment=replace(p.experiment, outputs=outputs)) for p in group]
