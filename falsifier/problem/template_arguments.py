"""What templates of requirements have in common: their arguments, and the windows in which they apply."""

from collections.abc import Callable, Iterator
from math import floor, inf, isfinite
from typing import Annotated, Any, ClassVar, NamedTuple, get_args, get_type_hints

from pydantic import AfterValidator, Field

from falsifier.errors import FalsifierError, FormulaError
from falsifier.problem.sections import ModelChanges, Seconds
from falsifier.stl import Formula, parse
from falsifier.stl.expression import Arithmetic, Call, Expression, Number
from falsifier.stl.formula import Always, And, Implies, Next, Not, Predicate, Window

# Decimals of times in s; finer than any grid.
_DECIMALS = 9


class TemplateError(FalsifierError):
    """Arguments of a template do not fit each other or the simulation.

    Attributes:
        key: the argument.
    """

    def __init__(self, key: str, message: str) -> None:
        self.key = key
        super().__init__(message)


class Clock(NamedTuple):
    """The end of the simulation and the step of the samples, in s; a step of 0 is not chosen yet."""

    stop_time: float
    step: float


# -- kinds of arguments --------------------------------------------------------------------------------------


def term(text: str | float) -> Expression:
    """Return the expression that an argument states.

    Raises:
        FormulaError: if it is no expression, or not finite.
    """
    if isinstance(text, int | float):
        if not isfinite(text):
            raise FormulaError("expected a finite number")
        return Number(float(text))
    formula = parse(f"({text}) <= 0")
    if not isinstance(formula, Predicate):
        raise FormulaError(f"expected a signal or an expression such as y2 - y1, got the formula {text}")
    return formula.left


def _read_by(read: Callable[[Any], object]) -> AfterValidator:
    """Return the check that an argument can be read."""

    def check(argument: Any) -> Any:
        try:
            read(argument)
        except FormulaError as error:
            raise ValueError(str(error)) from None
        return argument

    return AfterValidator(check)


def _moment(after: float | str) -> None:
    if isinstance(after, str):
        parse(after)
    elif not 0 <= after < inf:
        raise FormulaError(f"expected a time of at least 0 s, or a condition, got {after:g}")


def _checked_margin(margin: float | str) -> float | str:
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
    try:
        return float(margin.rstrip()[:-1]) / 100
    except ValueError:
        return None


Term = Annotated[str | float, _read_by(term)]
Condition = Annotated[str, _read_by(parse)]
Margin = Annotated[float | str, AfterValidator(_checked_margin)]
Moment = Annotated[float | str, _read_by(_moment)]
Duration = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


# -- what all templates do -----------------------------------------------------------------------------------


class Template(ModelChanges):
    """A requirement by template: its arguments, and what it overrides."""

    # One line on what it requires, for lists: that of its docstring.
    summary: ClassVar[str] = ""

    description: str = Field("", description="Its meaning in words.")
    during: tuple[Finite, Finite] | None = Field(
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
            TemplateError: naming the argument that does not fit the simulation.
        """
        return str(self._formula(Clock(stop_time, step)))

    def signals(self) -> Iterator[tuple[str, str]]:
        """Yield the argument and the name of each signal in it."""
        for key, value in self._stated(Term):
            yield from ((key, name) for name in term(value).signals)
        for key, condition in self._conditions():
            yield from ((key, name) for name in condition.signals)

    def _formula(self, clock: Clock) -> Formula:
        raise NotImplementedError

    def _stated(self, *kinds: object) -> Iterator[tuple[str, str | float]]:
        """Yield the arguments of some kinds that are given; of a list each item."""
        for key, hint in get_type_hints(type(self), include_extras=True).items():
            is_argument = key not in ModelChanges.model_fields
            if is_argument and any(kind in (hint, *get_args(hint)) for kind in kinds):
                value = getattr(self, key)
                values = value if isinstance(value, tuple) else (value,)
                yield from ((key, each) for each in values if each is not None)

    def _conditions(self) -> Iterator[tuple[str, Formula]]:
        for key, value in self._stated(Condition, Moment):
            if isinstance(value, str):
                yield key, parse(value)

    def _longest(self) -> str:
        """Return the argument to name if a requirement needs more time than there is."""
        times = {key: t for key, t in self._stated(Duration, Seconds, Moment) if not isinstance(t, str)}
        conditions = [key for key, _ in self._conditions()]
        return max(times, key=times.__getitem__) if times else (*conditions, "during")[0]

    def _after(
        self,
        after: float | str,
        clock: Clock,
        body: Callable[[float, float], Formula],
        *,
        lasts: float | None,
        begins: float = 0.0,
    ) -> Formula:
        """Return what must hold after a time, or each time when a condition becomes true.

        Args:
            after: time in s, or the condition.
            clock: end of the simulation, and step.
            body: what must hold, given the moment and the end relative to the time of evaluation, in s.
            lasts: time in s for which it must hold; None: to the end of the simulation.
            begins: time in s after the moment at which that begins.
        """
        if isinstance(after, str):
            assert lasts is not None
            return self._each_time(clock, parse(after), body(0.0, lasts), lasts)
        if self.during is not None:
            raise TemplateError("during", "applies only if after is a condition; state the time in after")
        end = clock.stop_time if lasts is None else after + lasts
        needed = max(after + begins, end)
        if needed > clock.stop_time:
            raise TemplateError(
                self._longest(),
                f"needs values up to {needed:g} s, but the simulation ends at {clock.stop_time:g} s: shorten "
                "the times or simulate longer",
            )
        return body(after, end)

    def _each_time(self, clock: Clock, condition: Formula, body: Formula, reach: float) -> Formula:
        """Return that something holds each time when a condition becomes true."""
        becomes = And(Not(condition), Next(condition))
        return Always(Implies(becomes, Next(body)), self._span(clock, reach + clock.step))

    def _span(self, clock: Clock, reach: float = 0.0) -> Window:
        """Return the window in which it applies: the given one, or as long as the simulation allows.

        Args:
            clock: end of the simulation, and step.
            reach: time in s that it looks ahead, besides what its conditions do.
        """
        inner = max((condition.horizon(clock.step) for _, condition in self._conditions()), default=0.0)
        latest = clock.stop_time - reach - inner
        if clock.step:
            latest = floor(latest / clock.step + 1e-6) * clock.step
        start, end = self.during or (0.0, latest)
        if self.during is not None and not 0 <= start <= end:
            raise TemplateError(
                "during", f"expected [start, end] with 0 <= start <= end, got [{start:g}, {end:g}]"
            )
        if end > latest + 1e-9 * clock.stop_time or latest < 0:
            needed = clock.stop_time - latest + (0.0 if self.during is None else end)
            cure = "shorten the times or simulate longer"
            if self.during is not None and latest >= start:
                cure = f"end the window at {latest:g} s, {cure}"
            raise TemplateError(
                self._longest() if self.during is None else "during",
                f"needs values up to {needed:g} s, but the simulation ends at {clock.stop_time:g} s: {cure}",
            )
        return window_of(start, end)


# -- parts of formulas ---------------------------------------------------------------------------------------


def near(signal: str | float, reference: str | float, within: float | str) -> Formula:
    """Return that a signal is within a margin of a reference."""
    x, r = term(signal), term(reference)
    return Predicate("<=", Call("abs", (Arithmetic("-", x, r),)), size_of(within, r, "within"))


def size_of(margin: float | str, reference: Expression, key: str) -> Expression:
    """Return a margin as an expression; a percentage is one of the reference's magnitude."""
    share = share_of(margin)
    if share is None:
        return Number(float(margin))
    if isinstance(reference, Number):
        if reference.value == 0:
            raise TemplateError(key, f"{margin} of the reference 0 is nothing; give a number")
        return Number(tidy(share * abs(reference.value)))
    return scaled(share, Call("abs", (reference,)))


def scaled(share: float, reference: Expression) -> Expression:
    """Return a share of a reference."""
    if isinstance(reference, Number):
        return Number(tidy(share * reference.value))
    return reference if share == 1 else Arithmetic("*", Number(share), reference)


def window_of(start: float, end: float) -> Window:
    """Return a window without the digits of rounding."""
    return Window(round(start, _DECIMALS), round(end, _DECIMALS))


def tidy(value: float) -> float:
    """Return a computed number without the digits of rounding, 1.6 for 0.02 * 80."""
    return float(f"{value:.12g}")
