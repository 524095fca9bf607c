"""What broke on a trajectory that violates a formula: what did not hold, when, and how far off it was.

Robustness is a minimum of maxima, so its critical time is where the verdict was nearest to changing. Of an
implication that is often the condition, which held. What a reader looks for is the consequence, while the
condition held; of ``or``, every alternative; of F and U, what was not reached within the window.

Negations are carried down instead of rewriting the formula: a demand is a part that had to be true, or false.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.core.words import in_unit, readable
from falsifier.stl import formula as stl
from falsifier.stl.diagnosis import seconds, valued
from falsifier.stl.expression import Expression, Number, unit_of
from falsifier.stl.lexer import name_text
from falsifier.stl.program import CompiledPart, Floats

Span = tuple[int, int]

# Maximum number of signals whose values are told of a condition.
_MOST_SIGNALS = 4


@dataclass(frozen=True, slots=True)
class Shortfall:
    """A comparison that had to hold and did not.

    Attributes:
        part: the comparison, as it had to hold.
        quantity: what it compares, the side that is not a plain number.
        value: its value at ``time``.
        limit: value of the other side at ``time``.
        start: start of the violating interval in s, the one with ``time`` if there are several; of what was
            never reached, of its window.
        end: end of that interval in s.
        time: when it was farthest from holding, in s; of what was never reached, when it was nearest.
        never: whether it had to hold at some time of the interval only, and never did.
        what: the comparison, the interval and the value in words.
        context: what made it necessary, such as conditions that held, in words.
    """

    part: str
    quantity: str
    value: float
    limit: float
    start: float
    end: float
    time: float
    never: bool
    what: str
    context: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Breach:
    """Why a formula is violated.

    Attributes:
        shortfalls: what did not hold; several if each would have been enough, in the order of the formula.
    """

    shortfalls: tuple[Shortfall, ...]

    @property
    def main(self) -> Shortfall:
        """The first shortfall."""
        return self.shortfalls[0]

    @property
    def lines(self) -> tuple[str, ...]:
        """What broke, one shortfall each, then what made it necessary."""
        count = len(self.shortfalls)
        numbers = [f"alternative {k} of {count}: " if count > 1 else "" for k in range(1, count + 1)]
        shared = [text for text in self.main.context if all(text in s.context for s in self.shortfalls)]
        own = ["".join(f"; {text}" for text in s.context if text not in shared) for s in self.shortfalls]
        return (*(f"{n}{s.what}{o}" for n, s, o in zip(numbers, self.shortfalls, own, strict=True)), *shared)

    @property
    def text(self) -> str:
        """The lines as one sentence, without a full stop."""
        return "; ".join(self.lines)


def find_breach(root: CompiledPart, buffer: Floats, trajectory: Trajectory) -> Breach:
    """Return what broke on a trajectory on which a formula has a negative value at time 0."""
    return Breach(tuple(_Search(buffer, trajectory).at(_Demand.of(root, wanted=True), _Spot(0))))


class _Demand(NamedTuple):
    """A part of a formula that had to be true, or false; no negation, as those are carried down."""

    part: CompiledPart
    wanted: bool

    @classmethod
    def of(cls, part: CompiledPart, *, wanted: bool) -> "_Demand":
        while isinstance(part.formula, stl.Not):
            part, wanted = part.children[0], not wanted
        return cls(part, wanted)

    @property
    def formula(self) -> stl.Formula:
        return self.part.formula

    @property
    def text(self) -> str:
        if isinstance(self.formula, stl.Flag):
            return f"{'' if self.wanted else 'not '}{self.formula.left}"
        return self.part.text if self.wanted else str(stl.negated(self.formula))

    @property
    def opposite(self) -> "_Demand":
        return _Demand(self.part, not self.wanted)

    @property
    def operands(self) -> list["_Demand"]:
        """The operands, with what is demanded of them; of a chain of one connective all at once."""
        formula, found = self.formula, [_Demand.of(child, wanted=self.wanted) for child in self.part.children]
        if isinstance(formula, stl.Implies):
            return [found[0].opposite, found[1]]
        if isinstance(formula, stl.And | stl.Or):
            chains = (
                each.operands
                if type(each.formula) is type(formula) and each.wanted is self.wanted
                else [each]
                for each in found
            )
            return [each for chain in chains for each in chain]
        return found

    @property
    def is_throughout(self) -> bool:
        return isinstance(self.formula, stl.Always if self.wanted else stl.Eventually)

    @property
    def is_sometime(self) -> bool:
        return isinstance(self.formula, stl.Eventually if self.wanted else stl.Always)

    @property
    def is_choice(self) -> bool:
        """Whether one of the operands would have been enough."""
        return isinstance(self.formula, stl.Or | stl.Implies if self.wanted else stl.And)

    def margins(self, buffer: Floats, span: Span) -> Floats:
        """By how much it is met at the samples of a span."""
        values = self.part.over(buffer, *span)
        return values if self.wanted else -values

    def met(self, buffer: Floats, span: Span) -> NDArray[np.bool_]:
        """At which samples of a span it is met; on a limit, too, the sign says so."""
        return self.margins(buffer, span) > 0


class _Spot(NamedTuple):
    """Where a demand was not met."""

    sample: int  # the sample
    scope: Span | None = None  # window in which it had to be met throughout; None if at this sample only
    guards: tuple[_Demand, ...] = ()  # demands from the operator of that window down to here
    held: tuple[_Demand, ...] = ()  # conditions at this sample that were met, which made it necessary
    notes: tuple[str, ...] = ()  # what else made it necessary, in words
    sought: str = ""  # what held at no time of a window, in words; here it came nearest

    def under(self, *conditions: _Demand) -> "_Spot":
        return self._replace(held=(*self.held, *conditions))


@dataclass(frozen=True, slots=True)
class _Search:
    """Descends from a demand that was not met to the comparisons that broke."""

    buffer: Floats
    trajectory: Trajectory

    def at(self, demand: _Demand, spot: _Spot) -> Iterator[Shortfall]:
        """Why a demand was not met at a sample."""
        spot = spot._replace(guards=(*spot.guards, demand))
        here = (spot.sample, spot.sample)
        window = demand.part.window_at(spot.sample) or here
        operands = demand.operands
        match demand.formula:
            case stl.Predicate():
                yield self._compared(demand, spot)
            case stl.Next():
                yield from self.at(operands[0], self._moved(spot, spot.sample + 1))
            case stl.Until() if demand.wanted:
                yield from self._until(operands[0], operands[1], window, spot)
            case stl.Until():
                left, right = operands
                met = self._first(right.opposite, window)
                note = f"after {left.opposite.text} held {_over(self._time(spot.sample), self._time(met))}"
                spot = self._moved(spot, met)
                yield from self.at(right, spot._replace(notes=(*spot.notes, note)))
            case stl.Implies() if demand.wanted:  # as a choice, a negated consequence would be a condition
                yield from self.at(operands[1], spot.under(operands[0].opposite))
            case stl.Iff():
                yield from self._unequal(demand, spot)
            case _ if demand.is_throughout:
                yield from self._throughout(operands[0], window, spot)
            case _ if demand.is_sometime:
                yield from self._never(operands[0], window, spot)
            case _ if demand.is_choice:
                # "not p or q" is read as "p -> q": what had to be false is a condition that held.
                refused, choices = ([d for d in operands if d.wanted is w] for w in (False, True))
                if choices:
                    spot = spot.under(*(d.opposite for d in refused))
                for choice in choices or operands:
                    yield from self.at(choice, spot)
            case _:
                yield from self.at(min(operands, key=lambda d: d.margins(self.buffer, here)[0]), spot)

    def _throughout(self, demand: _Demand, window: Span, spot: _Spot) -> Iterator[Shortfall]:
        """Why a demand was not met at every sample of a window."""
        if demand.is_throughout:
            yield from self._throughout(demand.operands[0], _inner(demand.part, window), spot)
        else:
            sample = window[0] + int(demand.margins(self.buffer, window).argmin())
            yield from self.at(demand, self._moved(spot, sample, window))

    def _never(self, demand: _Demand, window: Span, spot: _Spot) -> Iterator[Shortfall]:
        """Why a demand was met at no sample of a window."""
        if isinstance(demand.formula, stl.Predicate):
            yield self._compared(demand, self._settled(spot), window)
        elif demand.is_sometime:
            yield from self._never(demand.operands[0], _inner(demand.part, window), spot)
        elif demand.is_choice:
            for choice in demand.operands:
                yield from self._never(choice, window, spot)
        else:
            best = window[0] + int(demand.margins(self.buffer, window).argmax())
            if window[0] < window[1] and not spot.sought:
                over, near = _over(*map(self._time, window)), seconds(self._time(best))
                sought = f"{demand.text} held at no time {over}; it came nearest at {near}"
                spot = spot._replace(sought=sought)
            yield from self.at(demand, self._moved(spot, best))

    def _until(self, left: _Demand, right: _Demand, window: Span, spot: _Spot) -> Iterator[Shortfall]:
        if not right.met(self.buffer, window).any():
            yield from self._never(right, window, spot)
            return
        met = self._first(right, window)
        note = f"it had to hold until {right.text}, which held at {seconds(self._time(met))}"
        spot = self._settled(spot)
        yield from self._throughout(left, (spot.sample, met), spot._replace(notes=(*spot.notes, note)))

    def _unequal(self, demand: _Demand, spot: _Spot) -> Iterator[Shortfall]:
        """Why an equivalence failed, told from a side that held; if none did, from what the left one was."""
        left, right = (_Demand.of(child, wanted=True) for child in demand.part.children)
        is_true = bool(left.met(self.buffer, (spot.sample, spot.sample))[0])
        if demand.wanted and not is_true:
            left, right = right, left
        held = is_true or demand.wanted
        failed = right if held is demand.wanted else right.opposite
        yield from self.at(failed, spot.under(left if held else left.opposite))

    def _compared(self, demand: _Demand, spot: _Spot, window: Span | None = None) -> Shortfall:
        """The shortfall of a comparison: throughout a stretch, or within a window if that is given."""
        predicate = demand.formula
        assert isinstance(predicate, stl.Predicate)
        (first, last), several = (window, False) if window else self._stretch(demand, spot)
        margins = demand.margins(self.buffer, (first, last))
        sample = first + int(margins.argmax() if window else margins.argmin())
        values, units = self.trajectory.at(self._time(sample)), self.trajectory.units
        quantity, other = compared_sides(predicate)
        value, limit = (float(side.evaluate(values)) for side in (quantity, other))
        unit = unit_of(quantity, units) or unit_of(other, units)
        is_truth = isinstance(predicate, stl.Flag) and not unit and value in (0.0, 1.0)
        reading = valued(quantity, values, value - limit, unit)
        if is_truth:
            reading = f"{quantity} was {'true' if value else 'false'}"
        elif not isinstance(other, Number):
            reading += f", {valued(other, values, value - limit, unit_of(other, units) or unit)}"
        reading += "" if first == last else f" at {seconds(self._time(sample))}"
        reading += ", exactly on its limit" if value == limit else ""
        over = _over(self._time(first), self._time(last))
        if window and first != last:
            is_told = not is_truth and not isinstance(quantity, Number)
            what = f"{demand.text} held at no time {over}" + (f"; nearest was {reading}" if is_told else "")
        else:
            when = f"several times, worst {over}" if several else over
            # Of numbers alone, the comparison says it all.
            told = "" if isinstance(quantity, Number) else f": {reading}"
            what = f"{demand.text} was violated {when}{told}"
        return Shortfall(
            part=demand.text,
            quantity=str(quantity),
            value=value,
            limit=limit,
            start=self._time(first),
            end=self._time(last),
            time=self._time(sample),
            never=window is not None,
            what=f"{spot.sought}, but there {what}" if spot.sought else what,
            context=(*spot.notes, *(f"while {self._held(d, sample, now=True)}" for d in spot.held)),
        )

    def _stretch(self, demand: _Demand, spot: _Spot) -> tuple[Span, bool]:
        """The worst samples in a row at which no demand was met down to here; whether there are others."""
        if spot.scope is None:
            return (spot.sample, spot.sample), False
        low, high = spot.scope
        met = np.any([guard.met(self.buffer, spot.scope) for guard in spot.guards], axis=0)
        worst = low + int(np.where(met, np.inf, demand.margins(self.buffer, spot.scope)).argmin())
        good = np.flatnonzero(met) + low
        before, after = good[good < worst], good[good > worst]
        first, last = int(before.max(initial=low - 1)) + 1, int(after.min(initial=high + 1)) - 1
        return (first, last), len(good) + last - first < high - low

    def _settled(self, spot: _Spot) -> _Spot:
        """The same spot; its conditions are told with the time at which they were asked."""
        told = (f"after {self._held(condition, spot.sample)}" for condition in spot.held)
        return spot._replace(held=(), notes=(*spot.notes, *told))

    def _moved(self, spot: _Spot, sample: int, scope: Span | None = None) -> _Spot:
        return self._settled(spot)._replace(sample=sample, scope=scope, guards=())

    def _held(self, condition: _Demand, sample: int, *, now: bool = False) -> str:
        """Say that a condition held, with its signals' values; ``now``: where the shortfall was."""
        names, at, read = condition.formula.signals, seconds(self._time(sample)), ""
        is_now = not any(isinstance(f, stl.Next | stl.Temporal) for f in condition.formula.walk())
        if len(names) <= _MOST_SIGNALS and is_now:
            values, units = self.trajectory.at(self._time(sample)), self.trajectory.units
            read = ", ".join(
                in_unit(f"{name_text(n)} = {readable(values[n])}", units.get(n, "")) for n in names
            )
        if now:
            return f"{condition.text} held{f' ({read} at {at})' if read else ''}"
        return f"{condition.text} held at {at}{f' ({read})' if read else ''}"

    def _first(self, demand: _Demand, window: Span) -> int:
        """The first sample of a window at which a demand is met."""
        return window[0] + int(demand.met(self.buffer, window).argmax())

    def _time(self, sample: int) -> float:
        return float(self.trajectory.times[sample])


def _inner(part: CompiledPart, window: Span) -> Span:
    """The samples at which the operand of a temporal operator counts if it is evaluated over a window."""
    (first, _), (_, last) = part.window_at(window[0]) or window, part.window_at(window[1]) or window
    return first, last


def compared_sides(predicate: stl.Predicate) -> tuple[Expression, Expression]:
    """Return the quantity of a comparison, then the side that it is compared with."""
    if isinstance(predicate.left, Number):
        return predicate.right, predicate.left
    return predicate.left, predicate.right


def _over(start: float, end: float) -> str:
    return f"at {seconds(start)}" if start == end else f"from {readable(start)} to {seconds(end)}"
