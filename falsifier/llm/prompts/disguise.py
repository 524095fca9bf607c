"""Neutral names, so that the prompt does not say which system is searched.

Inputs are u1, u2, ..., parameters p1, ..., other signals y1, .... Units, descriptions, types and names of
enumeration items are left out. Numbers and times are real ones.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

from falsifier.core.candidate import Candidate
from falsifier.core.model import Causality, Kind, ModelInfo, Variable
from falsifier.core.ranges import InputRange, ParameterRange, ValueKind
from falsifier.core.space import SearchSpace
from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.evaluate import Evaluation, compiled
from falsifier.llm.prompts.view import View
from falsifier.problem.requirement import Requirement
from falsifier.stl import Verdict
from falsifier.stl.expression import Name
from falsifier.stl.formula import replaced

Ranged = TypeVar("Ranged", InputRange, ParameterRange)
T = TypeVar("T")


@dataclass(frozen=True)
class Disguise:
    """A view with neutral names, and the mapping back."""

    real: View
    names: Mapping[str, str]  # neutral names by real name

    @classmethod
    def of(cls, view: View) -> "Disguise":
        """Number the names of a view: inputs, parameters, then the signals of the formula and the model."""
        space, info = view.space, view.info
        signals = (
            *view.requirement.formula.signals,
            *view.experiment.outputs,
            *(v.name for v in info.inputs),
        )
        kinds = {
            "u": [r.name for r in space.inputs],
            "p": [p.name for p in space.parameters],
            "y": [name for name in dict.fromkeys(signals) if name not in space.names],
        }
        return cls(view, {n: f"{k}{i}" for k, real in kinds.items() for i, n in enumerate(real, start=1)})

    @cached_property
    def view(self) -> View:
        """The view that prompts are built from."""
        real, names, space = self.real, self.names, self.real.space
        others = [name for name in names if name not in space.names or name in real.info.starts]
        return View(
            info=ModelInfo(
                name="not named",
                description="Names are neutral and numbers have no units",
                variables=tuple(
                    Variable(names[name], self._kind(name), self._causality(name)) for name in others
                ),
            ),
            requirement=Requirement("R", replaced(real.requirement.formula, self._signals)),
            space=SearchSpace(
                tuple(map(self._range, space.inputs)),
                tuple(map(self._range, space.parameters)),
                space.stop_time,
            ),
            experiment=replace(real.experiment, outputs=tuple(names[n] for n in real.experiment.outputs)),
            is_named=False,
        )

    def hidden(self, evaluation: Evaluation) -> Evaluation:
        """Return an evaluation under neutral names, without the model's messages."""
        verdict, trajectory = evaluation.verdict, evaluation.trajectory
        if trajectory is not None:
            trajectory = Trajectory(trajectory.times, self.hidden_values(trajectory.columns))
        if verdict is not None:
            grid = self.view.experiment
            monitor = compiled(self.view.requirement.formula, grid.output_interval, grid.samples)
            told = monitor.evaluate(trajectory) if trajectory else self.hidden_verdict(verdict)
            verdict = replace(told, robustness=verdict.robustness)
        candidate = self.hidden_candidate(evaluation.candidate)
        return Evaluation(candidate, evaluation.status, verdict, trajectory=trajectory)

    def hidden_verdict(self, verdict: Verdict) -> Verdict:
        """Return a verdict without its trajectory; what broke is left out."""
        told = {str(p): str(replaced(p, self._signals)) for p in self.real.requirement.formula.predicates}
        predicate, values = told.get(verdict.predicate, ""), self.hidden_values(verdict.values)
        return Verdict(verdict.robustness, verdict.critical_time, predicate, values)

    def hidden_values(self, values: Mapping[str, T]) -> dict[str, T]:
        """Return values by neutral names, without those that are not shown."""
        return {self.names[name]: value for name, value in values.items() if name in self.names}

    def hidden_candidate(self, candidate: Candidate) -> Candidate:
        """Return what is searched of a candidate, under neutral names."""
        signals, parameters = self.hidden_values(candidate.signals), self.hidden_values(candidate.parameters)
        return Candidate(signals, parameters)

    def revealed(self, candidate: Candidate) -> Candidate:
        """Return a candidate as it can be simulated, with the real names in its rationale too."""
        real = {neutral: name for name, neutral in self.names.items()}
        return replace(
            candidate,
            signals={real[name]: signal for name, signal in candidate.signals.items()},
            parameters={real[name]: value for name, value in candidate.parameters.items()},
            rationale=re.sub(r"\b[upy]\d+\b", lambda m: real.get(m[0], m[0]), candidate.rationale),
        )

    def _range(self, r: Ranged) -> Ranged:
        """What may be chosen, in neutral words."""
        kind: ValueKind = "real" if r.kind == "real" else "integer"
        has_gaps = bool(r.items) and r.high - r.low >= len(r.numbers)
        items = tuple((str(n), n) for n in r.numbers) if has_gaps else ()
        return replace(r, name=self.names[r.name], unit="", description="", kind=kind, items=items)

    def _kind(self, name: str) -> Kind:
        """Whether a signal is discrete, which is told by its changes; no type is told but that."""
        return "real" if self.real.variable(name).kind == "real" else "enumeration"

    def _causality(self, name: str) -> Causality:
        """That of a signal; of one that starts at the parameter of the same name, not the parameter's."""
        known = self.real.variable(name).causality
        return "output" if known == "parameter" else known

    @cached_property
    def _signals(self) -> dict[Name, Name]:
        return {Name(real): Name(neutral) for real, neutral in self.names.items()}
