"""Neutral names and scales, so that the prompt does not reveal which system is searched.

Inputs are u1, u2, ..., parameters p1, ..., other signals y1, ..., derived ones z1, .... Units, descriptions,
types and names of enumeration items are left out. Times stay in seconds. The rules for numbers:

- What is searched runs from 0 to 1: its range is mapped linearly. Integers, Booleans and enumerations become
  levels between 0 and 1.
- Of every other signal the usual range is mapped linearly to 0.2 to 0.8. It is the one that the model
  declares, else that of all numbers that predicates compare the signal with and of its start values, widened
  by 1.3, so that the digits of the original do not stay. All of this is known before the first question. If
  it is a single number, that is 0.5 from the first question on, and the largest distance from it in the first
  trajectory determines how wide the range is.
- A predicate that compares one signal with a number keeps its form. Any other one is replaced by a derived
  signal that is compared with 0.5: its left side minus its right side, scaled as a signal of its own. Its
  coefficients would give the system away, and a sum of scaled signals is not the scaled sum.

Scales do not change during a run. Robustness is that of the scaled formula; its sign is that of the original
one.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.model import Kind, ModelInfo, Variable
from falsifier.core.signals import Signal
from falsifier.core.space import InputRange, ParameterRange, SearchSpace
from falsifier.core.trajectory import Trajectory, is_discrete
from falsifier.core.words import listed
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.observations import monitor_for
from falsifier.llm.prompts.scaling import (
    MIDDLE,
    Scale,
    compared_numbers,
    hidden_value,
    keeps_form,
    levels,
    margin,
    real_value,
    with_predicates,
)
from falsifier.llm.prompts.view import View
from falsifier.problem.requirement import Requirement
from falsifier.stl import Verdict
from falsifier.stl.expression import Name, Number
from falsifier.stl.formula import Predicate
from falsifier.stl.margins import is_on_limit

Columns = Mapping[str, NDArray[np.float64]]

# Of a signal between 0 and 1, so that it is told as exactly as one in the hundreds.
_MORE_DECIMALS = 2
_DESCRIPTION = (
    "Names are neutral and numbers have no units. Everything that you choose runs from 0 to 1. Each signal "
    "has a linear scale of its own, on which its usual values are between 0.2 and 0.8; robustness is that of "
    "scaled signals"
)
# Significant digits of numbers in a formula.
_DIGITS = 9


@dataclass(frozen=True)
class Disguise:
    """A view with neutral names and scales, and the mapping back.

    Attributes:
        real: the original view.
        names: neutral names by real name.
        derived: predicates that are told as derived signals, with what stands for the real names of these.
        scales: how signals are scaled, by real name.
        anchored: real names of signals whose scale has a middle before anything was simulated.
        whole: names of real signals that had few whole values in a trajectory.
        fractional: names of real signals that had other values in a trajectory.
    """

    real: View
    names: Mapping[str, str]
    derived: Mapping[Predicate, str]
    scales: Mapping[str, Scale]
    anchored: frozenset[str]
    whole: frozenset[str] = frozenset()
    fractional: frozenset[str] = frozenset()

    @classmethod
    def of(cls, view: View, start: Mapping[str, tuple[float, float]] | None = None) -> "Disguise":
        """Number the names of a view: inputs, parameters, then the signals of the formula and the model.

        Args:
            view: what is hidden.
            start: smallest and largest value of outputs at time 0, by name.
        """
        start = start or {}
        inputs = [r.name for r in view.space.inputs]
        parameters = [p.name for p in view.space.parameters]
        formula = view.requirement.formula
        seen = dict.fromkeys(
            (*formula.signals, *view.experiment.outputs, *(v.name for v in view.info.inputs))
        )
        others = [name for name in seen if name not in {*inputs, *parameters}]
        changed = [p for p in formula.predicates if not keeps_form(p)]
        # No variable has such a name.
        derived = {p: f"\0{k}" for k, p in enumerate(changed, start=1)}
        names = {
            **{name: f"u{i}" for i, name in enumerate(inputs, start=1)},
            **{name: f"p{i}" for i, name in enumerate(parameters, start=1)},
            **{name: f"y{i}" for i, name in enumerate(others, start=1)},
            **{name: f"z{i}" for i, name in enumerate(derived.values(), start=1)},
        }
        known: dict[str, list[float]] = {
            **{name: [*compared_numbers(formula, name), *start.get(name, ())] for name in others},
            **{name: _known_margins(p, start) for p, name in derived.items()},
        }
        scales = {name: Scale.of(numbers, _declared(view, name)) for name, numbers in known.items()}
        return cls(view, names, derived, scales, frozenset(name for name in known if known[name]))

    @cached_property
    def view(self) -> View:
        """The view that prompts are built from."""
        real, names = self.real, self.names
        hidden = {*self._searched, *self.derived.values()}
        kinds = {name: self._kind(name) for name in names if name not in hidden}
        variables = [
            *(Variable(names[name], kind=kind) for name, kind in kinds.items() if kind != "string"),  # type: ignore[arg-type]
            *(
                Variable(names[name], kind=self._kind_of(predicate), description=self._derivation(predicate))
                for predicate, name in self.derived.items()
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
        """The disguise with the scales and levels that trajectories determine; known scales stay."""
        found = self
        for trajectory in (e.trajectory for e in evaluations if e.trajectory is not None):
            columns = {n: c for n, c in trajectory.columns.items() if n in self.names}
            whole = {n for n, column in columns.items() if is_discrete(column, kind="real")}
            steady = {n for n, c in columns.items() if np.ptp(c) == 0 and c[0] == np.round(c[0])}
            scaled = self._scaled_columns(trajectory)
            scales = {
                n: scale.fitted(scaled[n], has_middle=n in self.anchored) if n in scaled else scale
                for n, scale in found.scales.items()
            }
            found = replace(
                found,
                scales=scales,
                whole=found.whole | whole,
                fractional=found.fractional | (columns.keys() - whole - steady),
            )
        return found

    def hidden(self, evaluation: Evaluation) -> Evaluation:
        """Return an evaluation under neutral names and scales, without the model's messages."""
        verdict, trajectory = evaluation.verdict, evaluation.trajectory
        shown = trajectory and Trajectory(trajectory.times, self._hidden_columns(trajectory))
        if verdict is not None:
            told = self.hidden_verdict(verdict) if shown is None else monitor_for(self.view).evaluate(shown)
            if is_on_limit(verdict.robustness):  # scaled limits are rounded
                told = replace(told, robustness=verdict.robustness)
            verdict = told
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
            robustness=self.hidden_robustness(verdict, verdict.robustness),
            predicate="" if predicate is None else str(self._predicates[predicate]),
            values={
                self.names[n]: self._hidden_number(n, v) for n, v in verdict.values.items() if n in self.names
            },
            breach=None,  # it tells real names and values
        )

    def canonical(self, candidate: Candidate) -> Candidate:
        """Return a hidden candidate as it comes back once it was simulated."""
        back = self.hidden_candidate(self.revealed(candidate))
        return replace(candidate, signals=back.signals, parameters=back.parameters)

    def hidden_robustness(self, verdict: Verdict, robustness: float) -> float:
        """Return a robustness in the scale of what decided a verdict on the same candidate."""
        predicate = next((p for p in self._predicates if str(p) == verdict.predicate), None)
        if predicate is None or is_on_limit(robustness):
            return robustness
        name = self.derived.get(predicate) or (*predicate.left.signals, *predicate.right.signals)[0]
        return robustness * (self._scaled(name, 1.0) - self._scaled(name, 0.0))

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
            p: Predicate(p.operator, Name(self.names[self.derived[p]]), Number(MIDDLE))
            if p in self.derived
            else self._rescaled(p)
            for p in self.real.requirement.formula.predicates
        }

    def _rescaled(self, predicate: Predicate) -> Predicate:
        """A predicate that keeps its form, over the scaled signal; scaled, it is no flag."""
        (name,) = (*predicate.left.signals, *predicate.right.signals)

        def side(part: object) -> Name | Number:
            if isinstance(part, Number):
                return Number(float(f"{self._scaled(name, part.value):.{_DIGITS}g}"))
            return Name(self.names[name])

        return Predicate(predicate.operator, side(predicate.left), side(predicate.right))

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
        return self.scales[name].number(value)

    def _scaled(self, name: str, value: float) -> float:
        """A value near what a signal is compared with; not rounded."""
        ranged = self._searched.get(name)
        if ranged is None:
            return self.scales[name].number(value)
        return (value - ranged.low) / (ranged.high - ranged.low or 1.0)

    def _kind(self, name: str) -> str:
        """Type of a signal; integer if its values are whole, which scaled ones do not show."""
        kind = self.real.kind(name)
        return "integer" if kind == "real" and name in self.whole - self.fractional else kind

    def _kind_of(self, predicate: Predicate) -> Kind:
        """Integer if all signals of a derived one are discrete, so that it is told as changes, too."""
        kinds = {self._kind(n) for n in (*predicate.left.signals, *predicate.right.signals)}
        return "real" if "real" in kinds else "integer"

    def _derivation(self, predicate: Predicate) -> str:
        """What a derived signal is made of, without numbers."""
        names = dict.fromkeys((*predicate.left.signals, *predicate.right.signals))
        return f"derived from {listed([self.names[name] for name in names])}"

    def _scaled_columns(self, trajectory: Trajectory) -> dict[str, NDArray[np.float64]]:
        """Columns that have scales, derived ones included, before they are scaled."""
        others = {n: c for n, c in trajectory.columns.items() if n in self.names and n not in self._searched}
        return others | {name: margin(p, trajectory.columns) for p, name in self.derived.items()}

    def _hidden_columns(self, trajectory: Trajectory) -> Columns:
        searched = {n: r for n, r in self._searched.items() if n in trajectory.columns}
        return {
            **{self.names[n]: (trajectory[n] - r.low) / (r.high - r.low or 1.0) for n, r in searched.items()},
            **{
                self.names[n]: self.scales[n].of_values(column)
                for n, column in self._scaled_columns(trajectory).items()
            },
        }


def _declared(view: View, name: str) -> tuple[float, float] | None:
    """Smallest and largest value that the model declares; None unless it declares both."""
    low, high = view.info[name].limits if name in view.info else (None, None)
    return None if low is None or high is None else (float(low), float(high))


def _known_margins(predicate: Predicate, start: Mapping[str, tuple[float, float]]) -> list[float]:
    """What is known of left minus right side before a simulation, so that 0 is in the middle."""
    names = {*predicate.left.signals, *predicate.right.signals}
    if not names <= start.keys() or any(low != high for low, high in (start[n] for n in names)):
        return [0.0]
    found = margin(predicate, {n: np.array([start[n][0]]) for n in names})
    size = float(np.abs(found).max())
    return [-size, size]
