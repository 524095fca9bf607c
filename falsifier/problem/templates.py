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

from collections.abc import Mapping
from itertools import combinations, pairwise
from typing import Literal, get_args

from pydantic import Field, model_validator

from falsifier.errors import FormulaError
from falsifier.problem.sections import Count, Duration, Number, Range, Seconds
from falsifier.problem.template_arguments import (
    Clock,
    Condition,
    Margin,
    Moment,
    Template,
    Term,
    near,
    share_of,
    size_of,
    tidy,
    total,
    window,
)
from falsifier.stl import parse

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

    def _formula(self, clock: Clock) -> str:
        inside = near(self.signal, self.reference, self.within)
        lasts = None if self.stays is None else total(self.time, self.stays)
        return self._from(self.after, clock, "G", inside, lasts=lasts, key="stays", begins=self.time)


class Overshoot(Template):
    """It exceeds a reference by at most a margin after a moment."""

    template: Literal["overshoot"]
    signal: Term = _SIGNAL
    reference: Term = _REFERENCE
    at_most: Margin = Field(description="Number in the signal's unit, or a percentage of the reference.")
    direction: Literal["up", "down"] = Field("up", description="down: at_most limits how far it falls below.")
    after: Moment = _AFTER
    duration: Duration | None = Field(
        None, description="How long it applies in s; default after a time: to the end of the simulation."
    )

    def _formula(self, clock: Clock) -> str:
        sides = (self.signal, self.reference)
        more, less = sides if self.direction == "up" else sides[::-1]
        bounded = f"{more} - ({less}) <= {size_of(self.at_most, self.reference)}"
        return self._from(self.after, clock, "G", bounded, lasts=self.duration, key="duration")


class Rise(Template):
    """It reaches a reference, or a share of it, at the latest some time after a moment."""

    template: Literal["rise"]
    signal: Term = _SIGNAL
    reference: Term = _REFERENCE
    reaches: Margin = Field(
        "90%", description="Percentage of the reference to reach; required if down, or of one below 0."
    )
    time: Duration = Field(description="Maximum time in s until it is reached.")
    direction: Literal["up", "down"] = Field("up", description="down: it falls to that share.")
    after: Moment = _AFTER

    @model_validator(mode="after")
    def _is_percentage(self) -> "Rise":
        if share_of(self.reaches) is None:
            raise ValueError(f"reaches is a percentage of the reference such as '90%', got {self.reaches!r}")
        is_negative = isinstance(self.reference, float) and self.reference < 0
        if (self.direction == "down" or is_negative) and "reaches" not in self.model_fields_set:
            of = (isinstance(self.reference, float) and self.reference) or 20
            raise ValueError(
                "with direction = 'down' or a negative reference, state reaches as well: "
                f"'110%' of {of:.12g} is {tidy(1.1 * of):.12g}, '90%' of it {tidy(0.9 * of):.12g}"
            )
        return self

    def _formula(self, clock: Clock) -> str:
        share, reference = share_of(self.reaches) or 0.0, self.reference
        if isinstance(reference, float):
            level = f"{tidy(share * reference)}"
        else:
            level = reference if share == 1 else f"{share} * ({reference})"
        operator = ">=" if self.direction == "up" else "<="
        return self._from(
            self.after, clock, "F", f"{self.signal} {operator} {level}", lasts=self.time, key="time"
        )


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

    def _formula(self, clock: Clock) -> str:
        then = f"G{window(0.0, self.stays)} ({self.then})" if self.stays else self.then
        answer = f"F{window(0.0, self.time)} ({then})"
        if self.on == "true":
            return self._throughout(f"({self.when}) -> {answer}", clock)
        return self._each_time(self.when, answer, clock)


class StaysWithin(Template):
    """It stays between limits, or near a reference."""

    template: Literal["stays_within"]
    signal: Term = _SIGNAL
    low: Term | None = Field(None, description="Lower limit: a number, a signal or an expression.")
    high: Term | None = Field(None, description="Upper limit.")
    reference: Term | None = Field(None, description="In place of low and high: what it stays near.")
    within: Margin | None = Field(None, description="How near: a number, or a percentage of the reference.")

    @model_validator(mode="after")
    def _limits_or_reference(self) -> "StaysWithin":
        limited = self.low is not None or self.high is not None
        is_near = self.reference is not None and self.within is not None
        if limited == is_near or (self.reference is None) != (self.within is None):
            raise ValueError("expected low, high or both; or reference and within")
        if isinstance(self.low, float) and isinstance(self.high, float) and self.low > self.high:
            raise ValueError(f"low is {self.low:.12g}, more than high, {self.high:.12g}: exchange them")
        return self

    def _formula(self, clock: Clock) -> str:
        if self.reference is not None and self.within is not None:
            return self._throughout(near(self.signal, self.reference, self.within), clock)
        low = "" if self.low is None else f"{self.low} <= "
        high = "" if self.high is None else f" <= {self.high}"
        return self._throughout(f"{low}{self.signal}{high}", clock)


class NeverTogether(Template):
    """No two conditions hold at the same time."""

    template: Literal["never_together"]
    conditions: tuple[Condition, ...] = Field(min_length=2, description="Two or more conditions.")

    def _formula(self, clock: Clock) -> str:
        pairs = (f"not (({a}) and ({b}))" for a, b in combinations(self.conditions, 2))
        return self._throughout(" and ".join(pairs), clock)


class Dwell(Template):
    """A condition that becomes true holds for at least or at most some time."""

    template: Literal["dwell"]
    condition: Condition = Field(description="Condition.")
    at_least: Duration | None = Field(None, description="Minimum time in s for which it holds.")
    at_most: Duration | None = Field(None, description="Maximum time in s for which it holds.")

    @model_validator(mode="after")
    def _limited(self) -> "Dwell":
        if self.at_least is None and self.at_most is None:
            raise ValueError("expected at_least, at_most or both, in s")
        if self.at_least is not None and self.at_most is not None and self.at_least >= self.at_most:
            raise ValueError("at_least must be less than at_most, as windows contain their ends")
        return self

    def _formula(self, clock: Clock) -> str:
        parts = []
        if self.at_least is not None:
            parts.append(f"G{window(0.0, self.at_least)} ({self.condition})")
        if self.at_most is not None:
            parts.append(f"F{window(0.0, self.at_most)} (not ({self.condition}))")
        return self._each_time(self.condition, " and ".join(parts), clock)


class RampLimit(Template):
    """It changes by at most so much per second.

    Formulas cannot compare values of two samples. Either the model has the rate as a signal, or the signal is
    compared at levels: if it is below a level, it is at most ``limit * over`` above that level for the next
    ``over`` seconds. A change that is too fast is then found for certain if it exceeds that by the distance
    of two levels, and no change that is slow enough is ever called too fast.
    """

    template: Literal["ramp_limit"]
    signal: Term = _SIGNAL
    limit: Number = Field(gt=0, description="Largest change per second, in the signal's unit.")
    rate: Term | None = Field(
        None, description="Signal that is its rate of change; default: der(signal), unless over is given."
    )
    over: Seconds | None = Field(
        None, description="Without a rate: time in s over which changes are judged, with range and levels."
    )
    range: Range | None = Field(None, description="With over: [low, high] of the signal.")
    levels: Count = Field(20, ge=1, le=_MOST_LEVELS, description="With over: number of levels in the range.")

    @model_validator(mode="after")
    def _one_way(self) -> "RampLimit":
        if (self.over is None) != (self.range is None) or (self.over is not None and self.rate is not None):
            raise ValueError("expected rate alone, or over and range together")
        if self.over is None and self.rate is None:
            try:
                parse(f"der({self.signal}) <= 0")
            except FormulaError:
                raise ValueError("an expression has no der(...): give rate, or over and range") from None
        return self

    def _formula(self, clock: Clock) -> str:
        if self.over is None or self.range is None:
            rate = f"der({self.signal})" if self.rate is None else self.rate
            return self._throughout(f"abs({rate}) <= {self.limit}", clock)
        change, x = self.limit * self.over, self.signal
        low, high = self.range
        over = window(0.0, self.over)
        parts = []
        for k in range(self.levels):
            level = low + (high - low) * (k + 0.5) / self.levels
            for operator, shift in (("<=", change), (">=", -change)):
                later = f"G{over} ({x} {operator} {tidy(level + shift)})"
                parts.append(f"({x} {operator} {tidy(level)} -> {later})")
        return self._throughout(" and ".join(parts), clock)


class Order(Template):
    """Each condition holds only once the one before it has held."""

    template: Literal["order"]
    conditions: tuple[Condition, ...] = Field(min_length=2, description="Two or more conditions, in order.")

    def _formula(self, clock: Clock) -> str:
        start, end = self._span(" and ".join(f"({c})" for c in self.conditions), clock)
        rest = window(0.0, total(end, -start))
        every = " and ".join(f"not (not ({a}) U{rest} ({b}))" for a, b in pairwise(self.conditions))
        return every if start == 0 else f"G{window(start, start)} ({every})"


_KINDS = (Settles, Overshoot, Rise, Response, StaysWithin, NeverTogether, Dwell, RampLimit, Order)
# By the names that their classes state.
TEMPLATES: Mapping[str, type[Template]] = {
    name: kind for kind in _KINDS for name in get_args(kind.model_fields["template"].annotation)
}
