"""Neutral names, so that the prompt does not reveal which system is searched."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

from falsifier.core.candidate import Candidate
from falsifier.core.model import ModelInfo
from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.view import View
from falsifier.problem.requirement import Requirement
from falsifier.stl import Verdict
from falsifier.stl.renaming import renamed

T = TypeVar("T")


@dataclass(frozen=True)
class Disguise:
    """A view with neutral names and without units and descriptions, and the mapping back.

    Attributes:
        real: the original view.
        names: neutral names by real name: inputs u1, u2, ..., parameters p1, ..., other signals y1, ...
    """

    real: View
    names: Mapping[str, str]

    @classmethod
    def of(cls, view: View) -> "Disguise":
        """Number the names of a view: inputs, parameters, then the signals of the formula and the model."""
        inputs = [r.name for r in view.space.inputs]
        parameters = [p.name for p in view.space.parameters]
        searched = {*inputs, *parameters}
        seen = dict.fromkeys(
            (*view.requirement.formula.signals, *view.experiment.outputs, *(v.name for v in view.info.inputs))
        )
        others = [name for name in seen if name not in searched]
        return cls(
            view,
            {
                **{name: f"u{i}" for i, name in enumerate(inputs, start=1)},
                **{name: f"p{i}" for i, name in enumerate(parameters, start=1)},
                **{name: f"y{i}" for i, name in enumerate(others, start=1)},
            },
        )

    @property
    def view(self) -> View:
        """The view that prompts are built from."""
        real, names = self.real, self.names
        return View(
            info=ModelInfo(
                name="",
                variables=tuple(
                    replace(v, name=names[v.name], unit="", display_unit="", description="")
                    for v in real.info.variables
                    if v.name in names
                ),
            ),
            requirement=Requirement("R", renamed(real.requirement.formula, names)),
            space=replace(
                real.space,
                inputs=tuple(
                    replace(r, name=names[r.name], unit="", description="", items=_neutral(r.items))
                    for r in real.space.inputs
                ),
                parameters=tuple(
                    replace(p, name=names[p.name], unit="", description="", items=_neutral(p.items))
                    for p in real.space.parameters
                ),
            ),
            experiment=replace(real.experiment, outputs=tuple(names[n] for n in real.experiment.outputs)),
        )

    def hidden(self, evaluation: Evaluation) -> Evaluation:
        """Return an evaluation under neutral names, without the model's messages: they may contain names."""
        verdict, trajectory = evaluation.verdict, evaluation.trajectory
        return replace(
            evaluation,
            candidate=self.hidden_candidate(evaluation.candidate),
            verdict=verdict and self.hidden_verdict(verdict),
            trajectory=trajectory and Trajectory(trajectory.times, self._by_neutral_name(trajectory.columns)),
            reason="",
            log=(),
        )

    def hidden_verdict(self, verdict: Verdict) -> Verdict:
        """Return a verdict under neutral names."""
        return replace(
            verdict,
            predicate=self._predicate(verdict.predicate),
            values=self._by_neutral_name(verdict.values),
        )

    def hidden_values(self, values: Mapping[str, T]) -> dict[str, T]:
        """Return values under neutral names, without those of signals that are not shown."""
        return self._by_neutral_name(values)

    def hidden_candidate(self, candidate: Candidate) -> Candidate:
        """Return a candidate under neutral names."""
        return Candidate(
            self._by_neutral_name(candidate.signals), self._by_neutral_name(candidate.parameters)
        )

    def revealed(self, candidate: Candidate) -> Candidate:
        """Return a candidate under its real names, in its rationale too."""
        real = {neutral: name for name, neutral in self.names.items()}
        return replace(
            candidate,
            signals={real[n]: s for n, s in candidate.signals.items()},
            parameters={real[n]: v for n, v in candidate.parameters.items()},
            rationale=re.sub(r"\b[upy]\d+\b", lambda m: real.get(m[0], m[0]), candidate.rationale),
        )

    def _by_neutral_name(self, values: Mapping[str, T]) -> dict[str, T]:
        return {self.names[n]: v for n, v in values.items() if n in self.names}

    def _predicate(self, text: str) -> str:
        found = (p for p in self.real.requirement.formula.predicates if str(p) == text)
        return str(renamed(next(found, ""), self.names))


def _neutral(items: tuple[tuple[str, int], ...]) -> tuple[tuple[str, int], ...]:
    return tuple((f"item {k}", number) for k, (_, number) in enumerate(items, start=1))
