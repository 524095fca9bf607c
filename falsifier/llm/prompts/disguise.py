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
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.model import Kind, ModelInfo, Variable
from falsifier.core.signals import Signal
from falsifier.core.space import InputRange, ParameterRange, SearchSpace, nearest_value
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import listed
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.observations import monitor_for
from falsifier.llm.prompts.view import View
from falsifier.problem.requirement import Requirement
from falsifier.stl import Verdict
from falsifier.stl.expression import Expression, Name, Number
from falsifier.stl.formula import Formula, Predicate
from falsifier.stl.margins import is_on_limit

Array = NDArray[np.float64]
Ranged = InputRange | ParameterRange

_MIDDLE = 0.5
# Half of the interval to which usual values are mapped, and the range of what is searched.
_HALF, _HALF_OF_SEARCHED = 0.3, 0.5
# Never a power of ten together with a round number: 80 * 1.25 would leave the digits of all others.
_HEADROOM = 1.3
# A declared range that is this much wider than the known values says nothing of how far the signal goes.
_VAGUE = 1000.0
# Maximum number of decimals of scaled values that were searched.
_DECIMALS = 12
# Levels that are listed; an integer with more of them is told as a plain number.
_MOST_LEVELS = 12
# Of a signal between 0 and 1, so that it is told as exactly as one in the hundreds.
_MORE_DECIMALS = 2
# Significant digits of numbers in a formula.
_DIGITS = 9
_DESCRIPTION = (
    "Names are neutral and numbers have no units. Everything that you choose runs from 0 to 1. Each signal "
    "has a linear scale of its own, on which its usual values are between 0.2 and 0.8; robustness is that of "
    "scaled signals"
)


@dataclass(frozen=True, slots=True)
class Scale:
    """A linear map of the usual values of a signal to a part of 0 to 1.

    Attributes:
        middle: what becomes 0.5.
        reach: distance from it to the ends of the usual values; 0: not known yet.
        half: what that distance becomes.
        has_middle: whether the middle is known, too.
    """

    middle: float = 0.0
    reach: float = 0.0
    half: float = _HALF
    has_middle: bool = False

    @classmethod
    def of(cls, known: Sequence[float], declared: tuple[float, float] | None) -> "Scale":
        """The scale that follows from numbers that matter for a signal, and from its declared range."""
        values = [n for n in known if np.isfinite(n)]
        low, high = (min(values), max(values)) if values else (0.0, 0.0)
        if declared is not None:
            width = declared[1] - declared[0]
            if np.isfinite(width) and width > 0 and (not values or width <= _VAGUE * (high - low or np.inf)):
                return cls(sum(declared) / 2, width / 2)
        return cls((low + high) / 2, _HEADROOM * (high - low) / 2, has_middle=bool(known))

    def fitted(self, column: Array) -> "Scale":
        """The scale that a first trajectory determines, if it is not known."""
        if self.reach or not column.size or not np.isfinite(column).all():
            return self
        least, most = float(column.min()), float(column.max())
        middle = self.middle if self.has_middle else (least + most) / 2
        return replace(self, middle=middle, reach=_HEADROOM * max(most - middle, middle - least))

    def number(self, value: float) -> float:
        """A scaled number."""
        return _MIDDLE + self.half * (value - self.middle) / (self.reach or 1.0)

    def column(self, values: Array) -> Array:
        """Scaled values of a signal."""
        return _MIDDLE + self.half * (values - self.middle) / (self.reach or 1.0)


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
        start, space, formula = start or {}, view.space, view.requirement.formula
        searched: list[Ranged] = [*space.inputs, *space.parameters]
        taken = {r.name for r in searched}
        seen = dict.fromkeys(
            (*formula.signals, *view.experiment.outputs, *(v.name for v in view.info.inputs))
        )
        others = [name for name in seen if name not in taken]
        changed = [p for p in formula.predicates if not _keeps_form(p)]
        # No variable has such a name.
        derived = {p: f"\0{k}" for k, p in enumerate(changed, start=1)}
        kinds = {
            "u": [r.name for r in space.inputs],
            "p": [p.name for p in space.parameters],
            "y": others,
            "z": derived.values(),
        }
        known: dict[str, list[float]] = {
            **{name: [*_compared_numbers(formula, name), *start.get(name, ())] for name in others},
            **{name: [0.0] for name in derived.values()},
        }
        scales = {name: Scale.of(numbers, _declared(view, name)) for name, numbers in known.items()}
        for r in searched:
            scales[r.name] = Scale((r.low + r.high) / 2, (r.high - r.low) / 2, _HALF_OF_SEARCHED)
        names = {name: f"{k}{i}" for k, real in kinds.items() for i, name in enumerate(real, start=1)}
        return cls(view, names, derived, scales)

    @cached_property
    def view(self) -> View:
        """The view that prompts are built from."""
        real, names, space = self.real, self.names, self.real.space
        hidden = {*self._searched, *self.derived.values()}
        kinds = {name: real.kind(name) for name in names if name not in hidden}
        variables = [Variable(names[name], kind=kind) for name, kind in kinds.items() if kind != "string"]
        for predicate, name in self.derived.items():
            of = dict.fromkeys(_signals(predicate))
            # Integer if all of them are discrete, so that it is told as changes, too.
            kind: Kind = "real" if "real" in map(real.kind, of) else "integer"
            description = f"derived from {listed([names[n] for n in of])}"
            variables.append(Variable(names[name], kind=kind, description=description))
        # What is searched runs from 0 to 1, and from 0 to 0 if there is no choice.
        inputs = (
            replace(
                r,
                name=names[r.name],
                low=0.0,
                high=_hidden_value(r, r.high),
                unit="",
                description="",
                kind="real",
                items=(),
            )
            for r in space.inputs
        )
        parameters = (
            ParameterRange(
                names[p.name],
                0.0,
                _hidden_value(p, p.high),
                nominal=None if p.nominal is None else _hidden_value(p, p.nominal),
            )
            for p in space.parameters
        )
        return View(
            info=ModelInfo(name="not named", description=_DESCRIPTION, variables=tuple(variables)),
            requirement=Requirement("R", _with_predicates(real.requirement.formula, self._predicates)),
            space=SearchSpace(tuple(inputs), tuple(parameters), space.stop_time),
            experiment=replace(real.experiment, outputs=tuple(names[n] for n in real.experiment.outputs)),
            levels={names[name]: found for name, r in self._searched.items() if (found := _levels(r))},
            tells_kinds=False,
            more_decimals=_MORE_DECIMALS,
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
        shown = None
        if trajectory is not None:
            columns = self._columns(trajectory)
            scaled = {self.names[n]: self.scales[n].column(c) for n, c in columns.items()}
            shown = Trajectory(trajectory.times, scaled)
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
        predicate = self._decider(verdict)
        return replace(
            verdict,
            robustness=self.hidden_robustness(verdict, verdict.robustness),
            predicate="" if predicate is None else str(self._predicates[predicate]),
            values={self.names[n]: self._number(n, v) for n, v in verdict.values.items() if n in self.names},
            breach=None,  # it tells real names and values
        )

    def canonical(self, candidate: Candidate) -> Candidate:
        """Return a hidden candidate as it comes back once it was simulated."""
        back = self.hidden_candidate(self.revealed(candidate))
        return replace(candidate, signals=back.signals, parameters=back.parameters)

    def hidden_robustness(self, verdict: Verdict, robustness: float) -> float:
        """Return a robustness in the scale of what decided a verdict on the same candidate."""
        predicate = self._decider(verdict)
        if predicate is None or is_on_limit(robustness):
            return robustness
        scale = self.scales[self.derived.get(predicate) or _signals(predicate)[0]]
        return robustness * scale.half / (scale.reach or 1.0)

    def hidden_values(self, values: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        """Return smallest and largest values under neutral names, without those that are not shown."""
        return {
            self.names[n]: (self._number(n, low), self._number(n, high))
            for n, (low, high) in values.items()
            if n in self.names
        }

    def hidden_candidate(self, candidate: Candidate) -> Candidate:
        """Return a candidate under neutral names, between 0 and 1."""
        signals = {n: s for n, s in candidate.signals.items() if n in self._searched}
        parameters = {n: v for n, v in candidate.parameters.items() if n in self._searched}
        return Candidate(
            {
                self.names[n]: replace(s, values=tuple(self._number(n, v) for v in s.values))
                for n, s in signals.items()
            },
            {self.names[n]: self._number(n, v) for n, v in parameters.items()},
        )

    def revealed(self, candidate: Candidate) -> Candidate:
        """Return a candidate as it can be simulated, with the real names in its rationale too."""
        real = {neutral: name for name, neutral in self.names.items()}

        def signal(r: Ranged, hidden: Signal) -> Signal:
            # Between control points, something discrete can only be held.
            manner = hidden.interpolation if r.kind == "real" else "constant"
            return replace(
                hidden, values=tuple(_real_value(r, v) for v in hidden.values), interpolation=manner
            )

        by_name = {n: self._searched[real[n]] for n in (*candidate.signals, *candidate.parameters)}
        return replace(
            candidate,
            signals={real[n]: signal(by_name[n], s) for n, s in candidate.signals.items()},
            parameters={real[n]: _real_value(by_name[n], v) for n, v in candidate.parameters.items()},
            rationale=re.sub(r"\b[upy]\d+\b", lambda m: real.get(m[0], m[0]), candidate.rationale),
        )

    @cached_property
    def _searched(self) -> dict[str, Ranged]:
        searched: list[Ranged] = [*self.real.space.inputs, *self.real.space.parameters]
        return {r.name: r for r in searched}

    @cached_property
    def _predicates(self) -> dict[Predicate, Predicate]:
        """Hidden predicates by real ones."""
        return {p: self._hidden_predicate(p) for p in self.real.requirement.formula.predicates}

    def _hidden_predicate(self, predicate: Predicate) -> Predicate:
        """The predicate over the scaled signal, or over what stands for it; scaled, a flag is none."""
        if predicate in self.derived:
            name = self.names[self.derived[predicate]]
            return Predicate(predicate.operator, Name(name), Number(_MIDDLE))
        (name,) = _signals(predicate)

        def side(part: Expression) -> Name | Number:
            if isinstance(part, Number):
                return Number(float(f"{self.scales[name].number(part.value):.{_DIGITS}g}"))
            return Name(self.names[name])

        return Predicate(predicate.operator, side(predicate.left), side(predicate.right))

    def _decider(self, verdict: Verdict) -> Predicate | None:
        return next((p for p in self._predicates if str(p) == verdict.predicate), None)

    def _number(self, name: str, value: float) -> float:
        if name in self._searched:
            return _hidden_value(self._searched[name], value)
        return self.scales[name].number(value)

    def _columns(self, trajectory: Trajectory) -> dict[str, Array]:
        """Columns by what has a scale, derived ones included, before they are scaled."""
        columns = {n: c for n, c in trajectory.columns.items() if n in self.names}
        return columns | {name: _margin(p, trajectory.columns) for p, name in self.derived.items()}


def _declared(view: View, name: str) -> tuple[float, float] | None:
    """Smallest and largest value that the model declares; None unless it declares both."""
    low, high = view.info[name].limits if name in view.info else (None, None)
    return None if low is None or high is None else (float(low), float(high))


def _hidden_value(ranged: Ranged, value: float) -> float:
    """A searched value between 0 and 1, with so many decimals that it comes back as it went.

    A narrow range far from 0 has fewer.
    """
    span = ranged.high - ranged.low
    if not span:
        return 0.0
    noise = 8 * np.finfo(float).eps * max(abs(ranged.low), abs(ranged.high)) / span
    decimals = int(np.clip(-np.log10(noise) - 1, 0, _DECIMALS)) if noise else _DECIMALS
    return round((value - ranged.low) / span, decimals)


def _real_value(ranged: Ranged, value: float) -> float:
    """The value that can be simulated; the limits come back exactly."""
    limits = {0.0: ranged.low, 1.0: ranged.high}
    found = limits.get(value, ranged.low + value * (ranged.high - ranged.low))
    return nearest_value(ranged, min(max(found, ranged.low), ranged.high))


def _levels(ranged: Ranged) -> tuple[float, ...]:
    """The scaled values that something discrete can take; empty for reals and if there are many."""
    if ranged.kind == "real" or ranged.high - ranged.low > 1000:
        return ()
    whole = np.arange(np.ceil(ranged.low), np.floor(ranged.high) + 1)
    found = sorted({nearest_value(ranged, float(n)) for n in whole})
    return tuple(round(_hidden_value(ranged, n), 6) for n in found) if len(found) <= _MOST_LEVELS else ()


def _compared_numbers(formula: Formula, name: str) -> Iterable[float]:
    """The numbers with which a signal alone is compared."""
    for predicate in formula.predicates:
        if _keeps_form(predicate) and _signals(predicate) == (name,):
            sides = (predicate.left, predicate.right)
            yield from (side.value for side in sides if isinstance(side, Number))


def _keeps_form(predicate: Predicate) -> bool:
    """Whether a predicate is told in its own form, not as a derived signal."""
    return len(_signals(predicate)) == 1 and all(
        isinstance(side, Name | Number) for side in (predicate.left, predicate.right)
    )


def _margin(predicate: Predicate, columns: Mapping[str, Array]) -> Array:
    """Left side minus right side."""
    return np.asarray(predicate.left.evaluate(columns) - predicate.right.evaluate(columns))


def _with_predicates(formula: Formula, predicates: Mapping[Predicate, Predicate]) -> Formula:
    """The formula with other predicates."""
    if isinstance(formula, Predicate):
        return predicates[formula]
    parts = (getattr(formula, field.name) for field in fields(formula))  # type: ignore[arg-type]
    return type(formula)(*(_with_predicates(p, predicates) if isinstance(p, Formula) else p for p in parts))


def _signals(predicate: Predicate) -> tuple[str, ...]:
    return (*predicate.left.signals, *predicate.right.signals)
