"""What templates of requirements have in common: their arguments, and the windows in which they apply."""

from math import floor, inf, isfinite
from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import AfterValidator, BeforeValidator, Field

from falsifier.core.experiment import GRID_ROUNDING, exact
from falsifier.core.literals import number_in, shortest
from falsifier.errors import FormulaError, SpecError
from falsifier.problem.sections import ModelChanges, Number, no_truth
from falsifier.stl import expression, parse
from falsifier.stl.formula import Predicate


class Clock(NamedTuple):
    """The end of the simulation and the step of the samples, in s; a step of 0 is not chosen yet."""

    stop_time: float
    step: float


# -- kinds of arguments --------------------------------------------------------------------------------------


def _term(text: str | float) -> str | float:
    """Return a number, or the text of an expression."""
    if isinstance(text, int | float):
        if not isfinite(text):
            raise ValueError("expected a finite number")
        return float(text)
    try:
        formula = parse(f"{text} <= 0")  # at its beginning, so that errors point at the right place
    except FormulaError as error:
        raise ValueError(str(error)) from None
    if not isinstance(formula, Predicate):
        raise ValueError(f"expected a signal or an expression such as y2 - y1, got the formula {text}")
    return formula.left.value if isinstance(formula.left, expression.Number) else str(formula.left)


def _condition(text: str) -> str:
    try:
        parse(text)
    except FormulaError as error:
        raise ValueError(str(error)) from None
    return text


def _moment(after: float | str) -> float | str:
    if isinstance(after, str):
        return _condition(after)
    if not 0 <= after < inf:
        raise ValueError(f"expected a time of at least 0 s, or a condition, got {after:g}")
    return after


def _margin(margin: float | str) -> float | str:
    size = share_of(margin) if isinstance(margin, str) else margin
    if size is None:
        raise ValueError(
            f"expected a number in the signal's unit, or a percentage such as '2%', got {margin!r}"
        )
    if not 0 <= size < inf:
        raise ValueError(f"expected a finite number of at least 0, got {margin}")
    return margin


def share_of(margin: float | str) -> float | None:
    """Return a percentage as a share; None if it is none."""
    if not isinstance(margin, str) or not margin.rstrip().endswith("%"):
        return None
    number = number_in(margin.rstrip()[:-1])
    return None if number is None else number / 100


Term = Annotated[str | float, BeforeValidator(no_truth), AfterValidator(_term)]
Condition = Annotated[str, AfterValidator(_condition)]
Margin = Annotated[float | str, BeforeValidator(no_truth), AfterValidator(_margin)]
Moment = Annotated[float | str, BeforeValidator(no_truth), AfterValidator(_moment)]


# -- parts of formulas, as text ------------------------------------------------------------------------------


def tidy(value: float) -> float:
    """Return a computed number without the digits of rounding, 1.6 for 0.02 * 80."""
    return float(f"{value:.12g}")


def total(*seconds: float) -> float:
    """Return the sum of times in s without the digits of rounding, 0.3 for 0.1 + 0.2."""
    return float(sum(map(exact, seconds)))


def window(start: float, end: float) -> str:
    """Return a window without the digits of rounding."""
    return f"[{shortest(total(start))},{shortest(total(end))}]"


def size_of(margin: float | str, reference: str | float) -> str:
    """Return a margin; a percentage is one of the reference's magnitude."""
    share = share_of(margin)
    if share is None:
        return f"{margin}"
    if reference == 0:
        raise SpecError(f"{margin} of the reference 0 is nothing; give a number")
    return (
        f"{tidy(share * abs(reference))}" if isinstance(reference, float) else f"{share} * abs({reference})"
    )


def near(signal: str | float, reference: str | float, within: float | str) -> str:
    """Return that a signal is within a margin of a reference."""
    return f"abs({signal} - ({reference})) <= {size_of(within, reference)}"


# -- what all templates do -----------------------------------------------------------------------------------


class Template(ModelChanges):
    """A requirement by template: its arguments, and what it overrides."""

    # One line on what it requires, for lists: that of its docstring.
    summary: ClassVar[str] = ""

    description: str = Field("", description="Its meaning in words.")
    during: tuple[Number, Number] | None = Field(
        None, description="[start, end] in s; default: as long as the simulation allows."
    )

    @classmethod
    def __pydantic_init_subclass__(cls, **_: object) -> None:
        """Take the summary from the docstring."""
        line = (cls.__doc__ or "").partition("\n")[0].rstrip(".")
        cls.summary = f"{line[:1].lower()}{line[1:]}"

    def expanded(self, stop_time: float, step: float = 0.0) -> str:
        """Return the text of the formula.

        Args:
            stop_time: end of the simulation in s.
            step: step of the time grid in s; 0: not chosen yet.

        Raises:
            SpecError: if the arguments do not fit each other or the simulation.
        """
        return str(parse(self._formula(Clock(stop_time, step))))

    def _formula(self, clock: Clock) -> str:
        raise NotImplementedError

    def _throughout(self, body: str, clock: Clock) -> str:
        """Return that something holds in the given window, or as long as the simulation allows."""
        return f"G{window(*self._span(body, clock))} ({body})"

    def _each_time(self, condition: str, body: str, clock: Clock) -> str:
        """Return that something holds each time when a condition becomes true."""
        return self._throughout(f"(not ({condition}) and X ({condition})) -> X ({body})", clock)

    def _from(
        self,
        after: float | str,
        clock: Clock,
        operator: Literal["G", "F"],
        body: str,
        *,
        lasts: float | None,
        key: str,
        begins: float = 0.0,
    ) -> str:
        """Return what must hold after a time, or each time when a condition becomes true.

        That begins ``begins`` s after the moment and lasts up to ``lasts`` s after it, as the argument
        ``key`` states; None: to the end of the simulation.
        """
        if isinstance(after, str):
            if lasts is None:
                raise SpecError("this key is missing: after a condition, say how long it lasts in s", key=key)
            return self._each_time(after, f"{operator}{window(begins, lasts)} ({body})", clock)
        if self.during is not None:
            raise SpecError("applies only if after is a condition; state the time in after", key="during")
        start, end = total(after, begins), clock.stop_time if lasts is None else total(after, lasts)
        if max(start, end) > clock.stop_time:
            raise _too_long(max(start, end), clock)
        return f"{operator}{window(start, end)} ({body})"

    def _span(self, body: str, clock: Clock) -> tuple[float, float]:
        """Return when it applies, in s: the given window, or as long as the simulation allows."""
        reach = parse(body).horizon(clock.step)
        latest = total(clock.stop_time, -reach)
        if clock.step:
            latest = float(floor(latest / clock.step + GRID_ROUNDING) * exact(clock.step))
        if self.during is None:
            if latest < 0:
                raise _too_long(reach, clock)
            return 0.0, latest
        start, end = self.during
        if not 0 <= start <= end:
            raise SpecError(
                f"expected [start, end] with 0 <= start <= end, got [{start:.12g}, {end:.12g}]", key="during"
            )
        if end > latest + 1e-9 * clock.stop_time:
            cure = f"end it at {latest:.10g} s, " if latest >= start else ""
            raise _too_long(reach + end, clock, cure=cure, key="during")
        return start, end


def _too_long(needed: float, clock: Clock, *, cure: str = "", key: str | None = None) -> SpecError:
    return SpecError(
        f"needs values up to {needed:.10g} s, but the simulation ends at {clock.stop_time:.10g} s: {cure}"
        "shorten the times or simulate longer",
        key=key,
    )
