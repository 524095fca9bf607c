"""Neutral names and scales, so that the prompt does not reveal which system is searched.

Inputs are u1, u2, ..., parameters p1, ..., other signals y1, ..., derived ones z1, .... What is searched runs
from 0 to 1, everything else is divided by a constant (``falsifier.llm.scaling`` states the rules). Units,
descriptions, types and names of enumeration items are left out. Times stay in seconds.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.signals import Signal
from falsifier.core.space import InputRange, ParameterRange, SearchSpace
from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.observations import monitor_for
from falsifier.llm.prompts.view import View
from falsifier.llm.scaling import (
    Scales,
    hidden_value,
    keeps_form,
    levels,
    margin,
    real_value,
    scaled_predicate,
    with_predicates,
)
from falsifier.problem.requirement import Requirement
from falsifier.stl import Verdict
from falsifier.stl.expression import Name, Number
from falsifier.stl.formula import Predicate

Columns = Mapping[str, NDArray[np.float64]]

# Of a signal between 0 and 1, so that it is told as exactly as one in the hundreds.
_MORE_DECIMALS = 2
_DESCRIPTION = (
    "Names are neutral and numbers have no units: everything that you choose runs from 0 to 1, and each "
    "signal is divided by a constant; signals that are compared have the same one"
)


@dataclass(frozen=True)
class Disguise:
    """A view with neutral names and scales, and the mapping back.

    Attributes:
        real: the original view.
        names: neutral names by real name.
        derived: predicates that are told as derived signals, with what stands for the real names of these.
        scales: constants by which signals are divided, by real name.
    """

    real: View
    names: Mapping[str, str]
    derived: Mapping[Predicate, str]
    scales: Scales

    @classmethod
    def of(cls, view: View) -> "Disguise":
        """Number the names of a view: inputs, parameters, then the signals of the formula and the model."""
        inputs = [r.name for r in view.space.inputs]
        parameters = [p.name for p in view.space.parameters]
        searched = {*inputs, *parameters}
        formula = view.requirement.formula
        seen = dict.fromkeys(
            (*formula.signals, *view.experiment.outputs, *(v.name for v in view.info.inputs))
        )
        others = [name for name in seen if name not in searched]
        changed = [p for p in formula.predicates if not keeps_form(p, searched)]
        # No variable has such a name.
        derived = {p: f"\0{k}" for k, p in enumerate(changed, start=1)}
        units = {name: view.unit(name) for name in others}
        names = {
            **{name: f"u{i}" for i, name in enumerate(inputs, start=1)},
            **{name: f"p{i}" for i, name in enumerate(parameters, start=1)},
            **{name: f"y{i}" for i, name in enumerate(others, start=1)},
            **{name: f"z{i}" for i, name in enumerate(derived.values(), start=1)},
        }
        return cls(view, names, derived, Scales.of(formula, (*others, *derived.values()), units, searched))

    @cached_property
    def view(self) -> View:
        """The view that prompts are built from."""
        real, names = self.real, self.names
        hidden = {*self._searched, *self.derived.values()}
        kinds = {name: real.kind(name) for name in names if name not in hidden}
        variables = [
            *(Variable(names[name], kind=kind) for name, kind in kinds.items() if kind != "string"),  # type: ignore[arg-type]
            *(
                Variable(names[name], description="derived from other signals")
                for name in self.derived.values()
            ),
        ]
        return View(
            info=ModelInfo(name="not named", description=_DESCRIPTION, variables=tuple(variables)),
            requirement=Requirement("R", with_predicates(real.requirement.formula, self._predicates)),
            space=SearchSpace(
                tuple(self._hidden_input(r) for r in real.space.inputs),
                tuple(self._hidden_parameter(p) for p in real.space.parameters),
                real.space.stop_time,
            ),
            experiment=replace(real.experiment, outputs=tuple(names[n] for n in real.experiment.outputs)),
            levels={names[name]: found for name, r in self._searched.items() if (found := levels(r))},
            tells_kinds=False,
            more_decimals=_MORE_DECIMALS,
        )

    def fitted(self, evaluations: Sequence[Evaluation]) -> "Disguise":
        """The disguise with the constants that trajectories determine; those known already stay."""
        found = self
        for trajectory in (e.trajectory for e in evaluations if e.trajectory is not None):
            largest = {
                n: float(np.abs(c).max(initial=0.0)) for n, c in self._scaled_columns(trajectory).items()
            }
            found = replace(found, scales=found.scales.fitted(largest))
        return found

    def fitted_to_start(self, start: Mapping[str, tuple[float, float]]) -> "Disguise":
        """The disguise with the constants that values at time 0 determine."""
        largest = {name: max(abs(low), abs(high)) for name, (low, high) in start.items()}
        return replace(self, scales=self.scales.fitted(largest))

    def hidden(self, evaluation: Evaluation) -> Evaluation:
        """Return an evaluation under neutral names and scales, without the model's messages."""
        verdict, trajectory = evaluation.verdict, evaluation.trajectory
        shown = trajectory and Trajectory(trajectory.times, self._hidden_columns(trajectory))
        if verdict is not None:
            verdict = (
                self.hidden_verdict(verdict) if shown is None else monitor_for(self.view).evaluate(shown)
            )
        return replace(
            evaluation,
            candidate=self.hidden_candidate(evaluation.candidate),
            verdict=verdict,
            trajectory=shown,
            reason="",
            log=(),
        )

    def hidden_verdict(self, verdict: Verdict) -> Verdict:
        """Return a verdict without its trajectory, in the scale of the predicate that decided it."""
        predicate = next((p for p in self._predicates if str(p) == verdict.predicate), None)
        return replace(
            verdict,
            robustness=verdict.robustness / self._unit(verdict),
            predicate="" if predicate is None else str(self._predicates[predicate]),
            values={
                self.names[n]: self._hidden_number(n, v) for n, v in verdict.values.items() if n in self.names
            },
        )

    def canonical(self, candidate: Candidate) -> Candidate:
        """Return a hidden candidate as it comes back once it was simulated."""
        back = self.hidden_candidate(self.revealed(candidate))
        return replace(candidate, signals=back.signals, parameters=back.parameters)

    def unit_of(self, evaluation: Evaluation) -> float:
        """What the robustness of an evaluation is divided by, in the scale of what decided it."""
        return 1.0 if evaluation.verdict is None else self._unit(evaluation.verdict)

    def _unit(self, verdict: Verdict) -> float:
        for predicate in self._predicates:
            if str(predicate) == verdict.predicate:
                if predicate in self.derived:
                    return self.scales[self.derived[predicate]]
                name = (*predicate.left.signals, *predicate.right.signals, "")[0]
                if name in self._searched:
                    return self._searched[name].high - self._searched[name].low or 1.0
                return self.scales[name]
        return 1.0

    def hidden_values(self, values: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        """Return smallest and largest values under neutral names, without those that are not shown."""
        return {
            self.names[n]: (self._hidden_number(n, low), self._hidden_number(n, high))
            for n, (low, high) in values.items()
            if n in self.names
        }

    def hidden_candidate(self, candidate: Candidate) -> Candidate:
        """Return a candidate under neutral names, between 0 and 1."""
        return Candidate(
            {
                self.names[n]: replace(s, values=tuple(self._hidden_number(n, v) for v in s.values))
                for n, s in candidate.signals.items()
                if n in self._searched
            },
            {
                self.names[n]: self._hidden_number(n, v)
                for n, v in candidate.parameters.items()
                if n in self._searched
            },
        )

    def revealed(self, candidate: Candidate) -> Candidate:
        """Return a candidate as it can be simulated, with the real names in its rationale too."""
        real = {neutral: name for name, neutral in self.names.items()}
        return replace(
            candidate,
            signals={
                real[n]: self._revealed(self._searched[real[n]], s) for n, s in candidate.signals.items()
            },
            parameters={
                real[n]: real_value(self._searched[real[n]], v) for n, v in candidate.parameters.items()
            },
            rationale=re.sub(r"\b[upy]\d+\b", lambda m: real.get(m[0], m[0]), candidate.rationale),
        )

    @cached_property
    def _searched(self) -> dict[str, InputRange | ParameterRange]:
        inputs: list[InputRange | ParameterRange] = [*self.real.space.inputs]
        return {r.name: r for r in (*inputs, *self.real.space.parameters)}

    @cached_property
    def _predicates(self) -> dict[Predicate, Predicate]:
        """Hidden predicates by real ones."""
        return {
            p: Predicate(p.operator, Name(self.names[self.derived[p]]), Number(0.0))
            if p in self.derived
            else scaled_predicate(p, self.scales, self.names, self._searched)
            for p in self.real.requirement.formula.predicates
        }

    def _hidden_input(self, r: InputRange) -> InputRange:
        low, high = hidden_value(r, r.low), hidden_value(r, r.high)
        return replace(
            r, name=self.names[r.name], low=low, high=high, unit="", description="", kind="real", items=()
        )

    def _hidden_parameter(self, p: ParameterRange) -> ParameterRange:
        low, high = hidden_value(p, p.low), hidden_value(p, p.high)
        nominal = None if p.nominal is None else hidden_value(p, p.nominal)
        return ParameterRange(self.names[p.name], low, high, nominal=nominal)

    def _revealed(self, ranged: InputRange | ParameterRange, signal: Signal) -> Signal:
        # Between control points, something discrete can only be held.
        manner = signal.interpolation if ranged.kind == "real" else "constant"
        values = tuple(real_value(ranged, v) for v in signal.values)
        return replace(signal, values=values, interpolation=manner)

    def _hidden_number(self, name: str, value: float) -> float:
        if name in self._searched:
            return hidden_value(self._searched[name], value)
        return value / self.scales[name]

    def _scaled_columns(self, trajectory: Trajectory) -> dict[str, NDArray[np.float64]]:
        """Columns that are divided by constants, derived ones included, before the division."""
        others = {n: c for n, c in trajectory.columns.items() if n in self.names and n not in self._searched}
        return others | {name: margin(p, trajectory.columns) for p, name in self.derived.items()}

    def _hidden_columns(self, trajectory: Trajectory) -> Columns:
        searched = {n: r for n, r in self._searched.items() if n in trajectory.columns}
        return {
            **{self.names[n]: (trajectory[n] - r.low) / (r.high - r.low or 1.0) for n, r in searched.items()},
            **{
                self.names[n]: column / self.scales[n]
                for n, column in self._scaled_columns(trajectory).items()
            },
        }
