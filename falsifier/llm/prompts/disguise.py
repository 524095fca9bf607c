"""Neutral names and scales, so that the prompt does not reveal which system is searched.

Inputs are u1, u2, ..., parameters p1, ..., other signals y1, ..., derived ones z1, .... Units, descriptions,
types and names of enumeration items are left out. Times stay in seconds. The rules for numbers:

- What is searched is mapped linearly: its range becomes 0 to 100. Integers, Booleans and enumerations of few
  values start at 0 and keep their steps.
- Of every other signal the usual range is mapped linearly to 20 to 80. It is the one that the model declares,
  else that of all numbers that predicates compare the signal with and of its start values, widened by 1.3, so
  that the digits of the original do not stay. All of this is known before the first question. If it is a
  single number, that is 50 from the first question on, and the largest distance from it in the first
  trajectory determines how wide the range is.
- A predicate that compares one signal with a number keeps its form. Any other one is replaced by a derived
  signal that is compared with 50: its left side minus its right side, scaled as a signal of its own. Its
  coefficients would give the system away, and a sum of scaled signals is not the scaled sum.

Scales do not change during a run. Robustness is that of the scaled formula; its sign is that of the original
one.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.model import Kind, ModelInfo, Variable
from falsifier.core.signals import Signal
from falsifier.core.space import InputRange, ParameterRange, SearchSpace, ValueKind, nearest_value
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import listed
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.observations import monitor_for
from falsifier.llm.prompts.view import View
from falsifier.problem.requirement import Requirement
from falsifier.stl import Verdict
from falsifier.stl.expression import Name, Number
from falsifier.stl.formula import Predicate, replaced
from falsifier.stl.margins import is_on_limit

Array = NDArray[np.float64]
Values = TypeVar("Values", float, Array)
Ranged = TypeVar("Ranged", InputRange, ParameterRange)

# What is searched runs up to this; of other signals, what the usual range becomes.
_TOP = 100.0
_LOW, _MIDDLE, _HIGH = 20.0, 50.0, 80.0
# Never a power of ten together with a round number: 80 * 1.25 would leave the digits of all others.
_HEADROOM = 1.3
# A declared range that is this much wider than the known values says nothing of how far the signal goes.
_VAGUE = 1000.0
# Values of an integer up to which these are told as integers.
_MOST_STEPS = 12
# Decimals of what is searched, without rounding errors, and significant digits of numbers in a formula.
_DECIMALS, _DIGITS = 10, 9
_DESCRIPTION = (
    "Names are neutral and numbers have no units. Each signal has a linear scale of its own, on which its "
    "usual values are between 20 and 80; robustness is that of scaled signals"
)


@dataclass(frozen=True, slots=True)
class Scale:
    """A linear map.

    Attributes:
        origin: what becomes ``target``; None: not known yet.
        factor: what differences are multiplied by; None: not known yet.
        target: what the origin becomes.
    """

    origin: float | None = None
    factor: float | None = None
    target: float = _MIDDLE

    @classmethod
    def of(cls, known: Sequence[float], declared: tuple[float | None, float | None]) -> "Scale":
        """The scale that follows from numbers that matter for a signal, and from its declared range."""
        low, high = (min(known), max(known)) if known else (0.0, 0.0)
        least, most = (np.nan if end is None else end for end in declared)
        if 0 < most - least < np.inf and (not known or most - least <= _VAGUE * (high - low or np.inf)):
            return cls((least + most) / 2, (_HIGH - _LOW) / (most - least))
        return cls((low + high) / 2 if known else None, _factor(high - low))

    def fitted(self, column: Array) -> "Scale":
        """The scale that a first trajectory determines, if it is not known."""
        if self.factor is not None or not np.isfinite(column).all():
            return self
        least, most = float(column.min()), float(column.max())
        origin = (least + most) / 2 if self.origin is None else self.origin
        return Scale(origin, _factor(2 * max(most - origin, origin - least)))

    def __call__(self, values: Values) -> Values:
        """Scale a number or a column."""
        return self.target + (self.factor or 1.0) * (values - (self.origin or 0.0))


def _factor(width: float) -> float | None:
    """The factor for usual values of this width; None: not known."""
    return (_HIGH - _LOW) / (_HEADROOM * width) if width else None


@dataclass(frozen=True)
class Disguise:
    """A view with neutral names and scales, and the mapping back.

    Attributes:
        real: the original view.
        names: neutral names by real name.
        derived: predicates that are told as derived signals, with what stands for the real names of these.
        scales: how everything is scaled, by real name.
    """

    real: View
    names: Mapping[str, str]
    derived: Mapping[Predicate, str]
    scales: Mapping[str, Scale]

    @classmethod
    def of(cls, view: View, start: Mapping[str, tuple[float, float]] | None = None) -> "Disguise":
        """Number the names of a view: inputs, parameters, then the signals of the formula and the model.

        Args:
            view: what is hidden.
            start: smallest and largest value of outputs at time 0, by name.
        """
        start, info, formula = start or {}, view.info, view.requirement.formula
        signals = (*formula.signals, *view.experiment.outputs, *(v.name for v in info.inputs))
        others = [name for name in dict.fromkeys(signals) if name not in view.space.names]
        limits = [found for p in formula.predicates if (found := _compared(p))]
        changed = [p for p in formula.predicates if not _compared(p)]
        # No variable has such a name.
        derived = {p: f"\0{k}" for k, p in enumerate(changed, start=1)}
        scales = dict.fromkeys(derived.values(), Scale(0.0))
        for name in others:
            known = [*(limit for of, limit in limits if of == name), *start.get(name, ())]
            declared = info[name].limits if name in info else (None, None)
            scales[name] = Scale.of([n for n in known if np.isfinite(n)], declared)
        for r in (*view.space.inputs, *view.space.parameters):
            keeps_steps = r.kind != "real" and r.high - r.low <= _MOST_STEPS
            scales[r.name] = Scale(r.low, 1.0 if keeps_steps else _TOP / (r.high - r.low or _TOP), 0.0)
        kinds = {
            "u": [r.name for r in view.space.inputs],
            "p": [p.name for p in view.space.parameters],
            "y": others,
            "z": derived.values(),
        }
        names = {name: f"{k}{i}" for k, real in kinds.items() for i, name in enumerate(real, start=1)}
        return cls(view, names, derived, scales)

    @cached_property
    def view(self) -> View:
        """The view that prompts are built from."""
        real, names, space = self.real, self.names, self.real.space
        told: dict[str, tuple[str, ...]] = {name: (name,) for name in names if name not in space.names}
        told |= {name: predicate.signals for predicate, name in self.derived.items()}
        variables = []
        for name, signals in told.items():
            # What is discrete is told by its changes; no type is told but that.
            kind: Kind = "real" if "real" in map(real.kind, signals) else "enumeration"
            derived = f"derived from {listed([names[n] for n in signals])}" if signals != (name,) else ""
            variables.append(Variable(names[name], kind, description=derived))
        parameters = (
            replace(self._range(p), nominal=None if p.nominal is None else self._number(p.name, p.nominal))
            for p in space.parameters
        )
        return View(
            info=ModelInfo(name="not named", description=_DESCRIPTION, variables=tuple(variables)),
            requirement=Requirement("R", replaced(real.requirement.formula, self._predicates)),
            space=SearchSpace(tuple(map(self._range, space.inputs)), tuple(parameters), space.stop_time),
            experiment=replace(real.experiment, outputs=tuple(names[n] for n in real.experiment.outputs)),
        )

    def fitted(self, evaluations: Sequence[Evaluation]) -> "Disguise":
        """The disguise with the scales that trajectories determine; known scales stay."""
        scales = dict(self.scales)
        for trajectory in (e.trajectory for e in evaluations if e.trajectory is not None):
            scales |= {n: scales[n].fitted(c) for n, c in self._columns(trajectory).items()}
        return replace(self, scales=scales)

    def hidden(self, evaluation: Evaluation) -> Evaluation:
        """Return an evaluation under neutral names and scales, without the model's messages."""
        verdict, trajectory = evaluation.verdict, evaluation.trajectory
        if trajectory is not None:
            columns = self._columns(trajectory).items()
            trajectory = Trajectory(trajectory.times, {self.names[n]: self.scales[n](c) for n, c in columns})
        if verdict is not None:
            told = monitor_for(self.view).evaluate(trajectory) if trajectory else self.hidden_verdict(verdict)
            # Scaled limits are rounded.
            exact = verdict.robustness if is_on_limit(verdict.robustness) else told.robustness
            verdict = replace(told, robustness=exact)
        candidate = self.hidden_candidate(evaluation.candidate)
        return Evaluation(candidate, evaluation.status, verdict, trajectory=trajectory)

    def hidden_verdict(self, verdict: Verdict) -> Verdict:
        """Return a verdict without its trajectory, in the scale of the predicate that decided it."""
        predicate = self._decider(verdict)
        return Verdict(
            self.hidden_robustness(verdict, verdict.robustness),
            verdict.critical_time,
            "" if predicate is None else str(self._predicates[predicate]),
            {self.names[n]: self.scales[n](v) for n, v in verdict.values.items() if n in self.names},
        )

    def hidden_robustness(self, verdict: Verdict, robustness: float) -> float:
        """Return a robustness in the scale of what decided a verdict on the same candidate."""
        predicate = self._decider(verdict)
        if predicate is None or is_on_limit(robustness):
            return robustness
        return robustness * (self.scales[self.derived.get(predicate) or predicate.signals[0]].factor or 1.0)

    def hidden_values(self, values: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        """Return smallest and largest values under neutral names, without those that are not shown."""
        return {
            self.names[n]: (self.scales[n](low), self.scales[n](high))
            for n, (low, high) in values.items()
            if n in self.names
        }

    def hidden_candidate(self, candidate: Candidate) -> Candidate:
        """Return what is searched of a candidate, under neutral names and scales."""
        signals = {r.name: candidate.signals[r.name] for r in self.real.space.inputs}
        parameters = {p.name: candidate.parameters[p.name] for p in self.real.space.parameters}
        return Candidate(
            {
                self.names[n]: replace(s, values=tuple(self._number(n, v) for v in s.values))
                for n, s in signals.items()
            },
            {self.names[n]: self._number(n, v) for n, v in parameters.items()},
        )

    def revealed(self, candidate: Candidate) -> Candidate:
        """Return a candidate as it can be simulated, with the real names in its rationale too."""
        names, space = self.names, self.real.space

        def value(r: InputRange | ParameterRange, hidden: float) -> float:
            share = hidden / (self._number(r.name, r.high) or 1.0)
            real = (1 - share) * r.low + share * r.high  # the limits come back exactly
            return nearest_value(r, min(max(real, r.low), r.high))

        def signal(r: InputRange, hidden: Signal) -> Signal:
            # Between control points, something discrete can only be held.
            manner = hidden.interpolation if r.kind == "real" else "constant"
            return replace(hidden, values=tuple(value(r, v) for v in hidden.values), interpolation=manner)

        real = {neutral: name for name, neutral in names.items()}
        return replace(
            candidate,
            signals={r.name: signal(r, candidate.signals[names[r.name]]) for r in space.inputs},
            parameters={p.name: value(p, candidate.parameters[names[p.name]]) for p in space.parameters},
            rationale=re.sub(r"\b[upy]\d+\b", lambda m: real.get(m[0], m[0]), candidate.rationale),
        )

    def canonical(self, candidate: Candidate) -> Candidate:
        """Return a hidden candidate as it comes back once it was simulated."""
        back = self.hidden_candidate(self.revealed(candidate))
        return replace(candidate, signals=back.signals, parameters=back.parameters)

    def _range(self, r: Ranged) -> Ranged:
        """What may be chosen, in neutral words."""
        high = self._number(r.name, r.high)
        kind: ValueKind = "real" if r.kind == "real" or high == _TOP else "integer"
        return replace(
            r, name=self.names[r.name], low=0.0, high=high, unit="", description="", kind=kind, items=()
        )

    def _number(self, name: str, value: float) -> float:
        """A searched value, so that it comes back as it went."""
        return round(self.scales[name](value), _DECIMALS)

    @cached_property
    def _predicates(self) -> dict[Predicate, Predicate]:
        """Hidden predicates by real ones: over the scaled signal, or what stands for it."""
        found = {}
        for p in self.real.requirement.formula.predicates:
            name, limit = _compared(p) or (self.derived[p], 0.0)
            signal = Name(self.names[name])
            number = Number(float(f"{self.scales[name](limit):.{_DIGITS}g}"))
            sides = (number, signal) if isinstance(p.left, Number) else (signal, number)
            found[p] = Predicate(p.operator, *sides)  # scaled, a flag is none
        return found

    def _decider(self, verdict: Verdict) -> Predicate | None:
        return next((p for p in self._predicates if str(p) == verdict.predicate), None)

    def _columns(self, trajectory: Trajectory) -> dict[str, Array]:
        """Columns by what has a scale, derived ones included, before they are scaled."""
        columns = trajectory.columns
        shown = {n: c for n, c in columns.items() if n in self.names}
        return shown | {
            name: np.asarray(p.left.evaluate(columns) - p.right.evaluate(columns))
            for p, name in self.derived.items()
        }


def _compared(predicate: Predicate) -> tuple[str, float] | None:
    """The signal and the number of a predicate that is told in its own form; None for any other one."""
    match predicate.left, predicate.right:
        case (Name(name), Number(limit)) | (Number(limit), Name(name)):
            return name, limit
    return None
