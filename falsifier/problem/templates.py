"""Templates: usual kinds of requirements with typed arguments, each of which stands for one STL formula.

::

    [requirements.R]
    template = "settles"
    signal = "speed"
    reference = 80
    within = "2%"
    time = 3

Terms are written as in formulas, so that ``y5 - y4`` is a signal, too; conditions are formulas. Formulas look
forward only and know no value of another sample. So a condition *becomes* true between two samples: false at
one, true at the next; a condition that is true at time 0 does not become true there.

The first line of a template's docstring is what lists and prompts say of it.
"""

from collections.abc import Iterator, Mapping
from functools import reduce
from itertools import combinations, pairwise
from typing import Literal

from pydantic import Field, model_validator

from falsifier.problem.sections import Range, Seconds
from falsifier.problem.template_arguments import (
    Clock,
    Condition,
    Duration,
    Finite,
    Margin,
    Moment,
    Template,
    TemplateError,
    Term,
    near,
    scaled,
    share_of,
    size_of,
    term,
    tidy,
    window_of,
)
from falsifier.stl import Formula, parse
from falsifier.stl.expression import Arithmetic, Call, Expression, Name, Number
from falsifier.stl.formula import Always, And, Comparison, Eventually, Implies, Not, Or, Predicate, Until

# Maximum number of levels at which ramp_limit compares a signal with itself some time later.
_MOST_LEVELS = 30

_SIGNAL = Field(description="Signal, or an expression of signals.")
_REFERENCE = Field(description="What it is compared with: a number, a signal or an expression.")
_AFTER = Field(
    0.0, description="Time in s, or a condition: then it applies each time when the condition becomes true."
)


class Settles(Template):
    """It is near a reference at the latest some time after a moment, and stays there."""

    template: Literal["settles"]
    signal: Term = _SIGNAL
    reference: Term = _REFERENCE
    within: Margin = Field(description="Number in the signal's unit, or a percentage of the reference, '2%'.")
    time: Duration = Field(description="Time in s after which it has settled.")
    after: Moment = _AFTER
    stays: Duration | None = Field(
        None, description="How long it stays there in s; default after a time: to the end of the simulation."
    )

    def _formula(self, clock: Clock) -> Formula:
        inside = near(self.signal, self.reference, self.within)
        if isinstance(self.after, str) and self.stays is None:
            raise TemplateError(
                "stays", "this key is missing: after a condition, say how long it stays there"
            )

        def settled(start: float, end: float) -> Formula:
            return Always(inside, window_of(start + self.time, end))

        lasts = None if self.stays is None else self.time + self.stays
        return self._after(self.after, clock, settled, lasts=lasts, begins=self.time)


class Overshoot(Template):
    """It exceeds a reference by at most a margin after a moment."""

    template: Literal["overshoot"]
    signal: Term = _SIGNAL
    reference: Term = _REFERENCE
    at_most: Margin = Field(description="Number in the signal's unit, or a percentage of the reference.")
    direction: Literal["up", "down"] = Field("up", description="down: falls below the reference by at most.")
    after: Moment = _AFTER
    duration: Duration | None = Field(
        None, description="How long it applies in s; default after a time: to the end of the simulation."
    )

    def _formula(self, clock: Clock) -> Formula:
        if isinstance(self.after, str) and self.duration is None:
            raise TemplateError(
                "duration", "this key is missing: after a condition, say for how long it applies"
            )
        signal, reference = term(self.signal), term(self.reference)
        sides = (signal, reference) if self.direction == "up" else (reference, signal)
        bounded = Predicate("<=", Arithmetic("-", *sides), size_of(self.at_most, reference, "at_most"))

        def kept(start: float, end: float) -> Formula:
            return Always(bounded, window_of(start, end))

        return self._after(self.after, clock, kept, lasts=self.duration)


class Rise(Template):
    """It reaches a reference, or a share of it, at the latest some time after a moment."""

    template: Literal["rise"]
    signal: Term = _SIGNAL
    reference: Term = _REFERENCE
    reaches: Margin = Field(
        "90%", description="Share of the reference that is reached, as a percentage; state it if down."
    )
    time: Duration = Field(description="Time in s until then, at most.")
    direction: Literal["up", "down"] = Field("up", description="down: it falls to that share.")
    after: Moment = _AFTER

    @model_validator(mode="after")
    def _is_percentage(self) -> "Rise":
        if share_of(self.reaches) is None:
            raise ValueError(f"reaches is a percentage of the reference such as '90%', got {self.reaches!r}")
        if self.direction == "down" and "reaches" not in self.model_fields_set:
            raise ValueError(
                "with direction = 'down', state reaches as well: of a reference of 20, '110%' is a fall to "
                "22, '90%' one to 18"
            )
        return self

    def _formula(self, clock: Clock) -> Formula:
        operator: Comparison = ">=" if self.direction == "up" else "<="
        level = scaled(share_of(self.reaches) or 0.0, term(self.reference))
        reached = Predicate(operator, term(self.signal), level)

        def risen(start: float, end: float) -> Formula:
            return Eventually(reached, window_of(start, end))

        return self._after(self.after, clock, risen, lasts=self.time)


class Response(Template):
    """Whenever one condition holds, another one follows within some time."""

    template: Literal["response"]
    when: Condition = Field(description="Condition.")
    then: Condition = Field(description="Condition that must follow.")
    time: Duration = Field(description="Time in s within which it follows.")
    stays: Duration = Field(0.0, description="How long it then holds in s.")
    on: Literal["true", "rising"] = Field(
        "true", description="true: at each time when the condition holds; rising: only when it becomes true."
    )

    def _formula(self, clock: Clock) -> Formula:
        when, then = parse(self.when), parse(self.then)
        if self.stays:
            then = Always(then, window_of(0.0, self.stays))
        answer = Eventually(then, window_of(0.0, self.time))
        reach = self.time + self.stays
        if self.on == "true":
            return Always(Implies(when, answer), self._span(clock, reach))
        return self._each_time(clock, when, answer, reach)


class StaysWithin(Template):
    """It stays between limits, or near a reference."""

    template: Literal["stays_within"]
    signal: Term = _SIGNAL
    low: Term | None = Field(None, description="Lower limit: a number, a signal or an expression.")
    high: Term | None = Field(None, description="Upper limit.")
    reference: Term | None = Field(None, description="In place of limits: what it stays near.")
    within: Margin | None = Field(None, description="With reference: a number, or a percentage of it.")

    @model_validator(mode="after")
    def _limits_or_reference(self) -> "StaysWithin":
        limited = self.low is not None or self.high is not None
        is_near = self.reference is not None and self.within is not None
        if limited == is_near or (self.reference is None) != (self.within is None):
            raise ValueError("expected low, high or both; or reference and within")
        if isinstance(self.low, float) and isinstance(self.high, float) and self.low > self.high:
            raise ValueError(f"low is {self.low:g}, more than high, {self.high:g}: exchange them")
        return self

    def _formula(self, clock: Clock) -> Formula:
        window = self._span(clock)
        if self.reference is not None and self.within is not None:
            return Always(near(self.signal, self.reference, self.within), window)
        signal = term(self.signal)
        parts: list[Formula] = []
        if self.low is not None:
            parts.append(Predicate("<=", term(self.low), signal))
        if self.high is not None:
            parts.append(Predicate("<=", signal, term(self.high)))
        return Always(reduce(And, parts), window)


class NeverTogether(Template):
    """No two conditions hold at the same time."""

    template: Literal["never_together"]
    conditions: tuple[Condition, ...] = Field(min_length=2, description="Two or more conditions.")

    def _formula(self, clock: Clock) -> Formula:
        pairs: list[Formula] = [Not(And(a, b)) for a, b in combinations(map(parse, self.conditions), 2)]
        return Always(reduce(And, pairs), self._span(clock))


class Dwell(Template):
    """A condition that becomes true holds for at least or at most some time."""

    template: Literal["dwell"]
    condition: Condition = Field(description="Condition.")
    at_least: Duration | None = Field(None, description="How long it holds in s, at least.")
    at_most: Duration | None = Field(None, description="How long it holds in s, at most.")

    @model_validator(mode="after")
    def _limited(self) -> "Dwell":
        if self.at_least is None and self.at_most is None:
            raise ValueError("expected at_least, at_most or both, in s")
        if self.at_least is not None and self.at_most is not None and self.at_least > self.at_most:
            raise ValueError("at_least is more than at_most")
        return self

    def _formula(self, clock: Clock) -> Formula:
        condition = parse(self.condition)
        parts: list[Formula] = []
        if self.at_least is not None:
            parts.append(Always(condition, window_of(0.0, self.at_least)))
        if self.at_most is not None:
            parts.append(Eventually(Not(condition), window_of(0.0, self.at_most)))
        reach = max(self.at_least or 0.0, self.at_most or 0.0)
        return self._each_time(clock, condition, reduce(And, parts), reach)


class RampLimit(Template):
    """It changes by at most so much per second.

    Formulas cannot compare values of two samples. Either the model has the rate as a signal, or the signal is
    compared at levels: if it is below a level, it is at most ``limit * over`` above that level for the next
    ``over`` seconds. A change that is too fast is then found for certain if it exceeds that by the distance
    of two levels, and no change that is slow enough is ever called too fast.
    """

    template: Literal["ramp_limit"]
    signal: Term = _SIGNAL
    limit: Finite = Field(gt=0, description="Largest change per second, in the signal's unit.")
    rate: Term | None = Field(
        None, description="Signal that is its rate of change; default: der(signal), unless over is given."
    )
    over: Seconds | None = Field(
        None, description="Without a rate: time in s over which changes are judged, with range and levels."
    )
    range: Range | None = Field(None, description="With over: [low, high] of the signal.")
    levels: int = Field(20, ge=1, le=_MOST_LEVELS, description="With over: number of levels in the range.")

    @model_validator(mode="after")
    def _one_way(self) -> "RampLimit":
        if (self.over is None) != (self.range is None) or (self.over is not None and self.rate is not None):
            raise ValueError("expected rate alone, or over and range together")
        if self.over is None and self.rate is None and not isinstance(term(self.signal), Name):
            raise ValueError("an expression has no der(...): give rate, or over and range")
        return self

    def signals(self) -> Iterator[tuple[str, str]]:
        """Yield the argument and the name of each signal, also of the default rate."""
        yield from super().signals()
        if self.over is None and self.rate is None:
            yield from (("rate", name) for name in self._rate().signals)

    def _rate(self) -> Expression:
        if self.rate is not None:
            return term(self.rate)
        return Name(f"der({term(self.signal).signals[0]})")

    def _formula(self, clock: Clock) -> Formula:
        if self.over is None or self.range is None:
            slow = Predicate("<=", Call("abs", (self._rate(),)), Number(self.limit))
            return Always(slow, self._span(clock))
        change, signal = self.limit * self.over, term(self.signal)
        low, high = self.range
        sides: tuple[tuple[Comparison, float], ...] = (("<=", change), (">=", -change))
        parts: list[Formula] = []
        for k in range(self.levels):
            level = low + (high - low) * (k + 0.5) / self.levels
            for operator, shift in sides:
                here = Predicate(operator, signal, Number(tidy(level)))
                later = Predicate(operator, signal, Number(tidy(level + shift)))
                parts.append(Implies(here, Always(later, window_of(0.0, self.over))))
        return Always(_balanced(parts), self._span(clock, self.over))


class Order(Template):
    """Each condition holds only once the one before it has held."""

    template: Literal["order"]
    conditions: tuple[Condition, ...] = Field(min_length=2, description="Two or more conditions, in order.")

    def _formula(self, clock: Clock) -> Formula:
        window = self._span(clock)
        rest = window_of(0.0, window.end - window.start)
        parts: list[Formula] = []
        for first, later in pairwise(map(parse, self.conditions)):
            parts.append(Or(Always(Not(later), rest), Until(Or(Not(later), first), first, rest)))
        every = reduce(And, parts)
        return every if window.start == 0 else Always(every, window_of(window.start, window.start))


TEMPLATES: Mapping[str, type[Template]] = {
    "settles": Settles,
    "overshoot": Overshoot,
    "rise": Rise,
    "response": Response,
    "stays_within": StaysWithin,
    "never_together": NeverTogether,
    "dwell": Dwell,
    "ramp_limit": RampLimit,
    "order": Order,
}


def _balanced(parts: list[Formula]) -> Formula:
    """Return the conjunction of many parts without many levels."""
    if len(parts) == 1:
        return parts[0]
    half = len(parts) // 2
    return And(_balanced(parts[:half]), _balanced(parts[half:]))
