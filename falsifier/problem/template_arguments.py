"""What templates of requirements have in common: their arguments, and the windows in which they apply."""

import re
import tomllib
from collections.abc import Callable, Iterator
from math import floor, isfinite
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import AfterValidator, Field

from falsifier.errors import FalsifierError, FormulaError
from falsifier.problem.sections import ModelChanges
from falsifier.stl import Formula, parse
from falsifier.stl.expression import Arithmetic, Call, Expression, Number
from falsifier.stl.formula import Always, And, Implies, Next, Not, Predicate, Window

# Decimals of times in s; finer than any grid.
_DECIMALS = 9
_QUOTED = r"""(?:"(?:[^"\\]|\\.)*"|'[^']*')"""
# One argument on the command line: spaces only in quotes and in lists.
_ARGUMENT = re.compile(rf"""(?:=\[(?:{_QUOTED}|[^"'\]])*\]|{_QUOTED}|[^\s"'])+""")


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


def term(text: str | float) -> Expression:
    """Return the expression that an argument states.

    Raises:
        FormulaError: if it is no expression.
    """
    if isinstance(text, int | float):
        return Number(float(text))
    formula = parse(f"({text}) <= 0")
    if not isinstance(formula, Predicate):
        raise FormulaError(f"expected a signal or an expression such as y2 - y1, got the formula {text}")
    return formula.left


def _checked_term(text: str | float) -> str | float:
    if isinstance(text, float) and not isfinite(text):
        raise ValueError("expected a finite number")
    try:
        term(text)
    except FormulaError as error:
        raise ValueError(str(error)) from None
    return text


def _checked_condition(text: str) -> str:
    try:
        parse(text)
    except FormulaError as error:
        raise ValueError(str(error)) from None
    return text


def _checked_margin(margin: float | str) -> float | str:
    if share_of(margin) is None and not isinstance(margin, int | float):
        raise ValueError(
            f"expected a number in the signal's unit, or a percentage such as '2%', got {margin!r}"
        )
    size = share_of(margin) if isinstance(margin, str) else margin
    if size is None or not 0 <= size < float("inf"):
        raise ValueError(f"expected a finite number of at least 0, got {margin}")
    return margin


def _checked_moment(after: float | str) -> float | str:
    if isinstance(after, str):
        return _checked_condition(after)
    if not 0 <= after < float("inf"):
        raise ValueError(f"expected a time of at least 0 s, or a condition, got {after:g}")
    return after


def share_of(margin: float | str) -> float | None:
    """Return a percentage as a share; None if it is none."""
    if not isinstance(margin, str) or not margin.rstrip().endswith("%"):
        return None
    try:
        return float(margin.rstrip()[:-1]) / 100
    except ValueError:
        return None


Term = Annotated[str | float, AfterValidator(_checked_term)]
Condition = Annotated[str, AfterValidator(_checked_condition)]
Margin = Annotated[float | str, AfterValidator(_checked_margin)]
Moment = Annotated[float | str, AfterValidator(_checked_moment)]
Duration = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class Template(ModelChanges):
    """A requirement by template: its arguments, and what it overrides."""

    # One line on what it requires, for lists.
    summary: ClassVar[str] = ""
    # Arguments that name signals.
    terms: ClassVar[tuple[str, ...]] = ()
    conditions_in: ClassVar[tuple[str, ...]] = ()
    # Arguments that are times in s.
    times: ClassVar[tuple[str, ...]] = ()

    description: str = Field("", description="Its meaning in words.")

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
        for key in self.terms:
            if (value := getattr(self, key)) is not None:
                yield from ((key, name) for name in term(value).signals)
        for key in self.conditions_in:
            value = getattr(self, key)
            for text in value if isinstance(value, tuple) else (value,):
                if isinstance(text, str):
                    yield from ((key, name) for name in parse(text).signals)

    def _formula(self, clock: Clock) -> Formula:
        raise NotImplementedError


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


def after_moment(
    template: Template,
    clock: Clock,
    after: float | str,
    body: Callable[[float, float], Formula],
    *,
    lasts: float | None,
    during: tuple[float, float] | None,
) -> Formula:
    """Return what must hold after a time, or each time when a condition becomes true.

    Args:
        template: the template, for errors.
        clock: end of the simulation, and step.
        after: time in s, or the condition.
        body: what must hold, given the moment and the end relative to the time of evaluation, in s.
        lasts: time in s for which it must hold; None: to the end of the simulation.
        during: when a condition may become true.
    """
    if isinstance(after, str):
        assert lasts is not None
        return each_time(template, clock, parse(after), body(0.0, lasts), lasts, during)
    if during is not None:
        raise TemplateError("during", "applies only if after is a condition; state the time in after")
    end = clock.stop_time if lasts is None else after + lasts
    start = after + (getattr(template, "time", 0.0) if lasts is None else 0.0)
    needed = max(start, end)
    if needed > clock.stop_time:
        raise TemplateError(
            _longest(template),
            f"needs values up to {needed:g} s, but the simulation ends at {clock.stop_time:g} s: shorten the "
            "times or simulate longer",
        )
    return body(after, end)


def _longest(template: Template) -> str:
    """Return the argument to name if a requirement needs more time than there is."""
    times = {key: t for key in template.times if isinstance(t := getattr(template, key), int | float)}
    return max(times, key=times.__getitem__) if times else (*template.conditions_in, "during")[0]


def each_time(
    template: Template,
    clock: Clock,
    condition: Formula,
    body: Formula,
    reach: float,
    during: tuple[float, float] | None,
) -> Formula:
    """Return that something holds each time when a condition becomes true."""
    becomes = And(Not(condition), Next(condition))
    window = span(template, clock, reach + clock.step, during)
    return Always(Implies(becomes, Next(body)), window)


def span(template: Template, clock: Clock, reach: float, during: tuple[float, float] | None) -> Window:
    """Return the window in which it applies: the given one, or as long as the simulation allows."""
    inner = [parse(t).horizon(clock.step) for t in _conditions(template)]
    latest = clock.stop_time - reach - max(inner, default=0.0)
    if clock.step:
        latest = floor(latest / clock.step + 1e-6) * clock.step
    start, end = during or (0.0, latest)
    if during is not None and not 0 <= start <= end:
        raise TemplateError(
            "during", f"expected [start, end] with 0 <= start <= end, got [{start:g}, {end:g}]"
        )
    if end > latest + 1e-9 * clock.stop_time or latest < 0:
        needed = clock.stop_time - latest + (0.0 if during is None else end)
        cure = "shorten the times or simulate longer"
        if during is not None and latest >= start:
            cure = f"end the window at {latest:g} s, {cure}"
        raise TemplateError(
            _longest(template) if during is None else "during",
            f"needs values up to {needed:g} s, but the simulation ends at {clock.stop_time:g} s: {cure}",
        )
    return window_of(start, end)


def _conditions(template: Template) -> Iterator[str]:
    for key in template.conditions_in:
        value = getattr(template, key)
        yield from (t for t in (value if isinstance(value, tuple) else (value,)) if isinstance(t, str))


def window_of(start: float, end: float) -> Window:
    """Return a window without the digits of rounding."""
    return Window(round(start, _DECIMALS), round(end, _DECIMALS))


def tidy(value: float) -> float:
    """Return a computed number without the digits of rounding, 1.6 for 0.02 * 80."""
    return float(f"{value:.12g}")


def template_arguments(text: str) -> dict[str, Any]:
    """Return the section for a template on the command line: its name, then ``key=value`` in any order.

    Values are written as in TOML; text needs no quotes of its own unless it contains spaces.

    >>> template_arguments("settles signal=speed reference=80 within=2% time=3")["reference"]
    80

    Raises:
        FormulaError: naming what is not ``key=value``.
    """
    rest = _ARGUMENT.sub("", text).strip()
    if rest or not text.strip():
        problem = f"{rest}: a quote has no end" if rest else "empty"
        raise FormulaError(
            f"--template: {problem}; write a template and its arguments: 'settles signal=speed ...'"
        )
    name, *pairs = _ARGUMENT.findall(text)
    found: dict[str, Any] = {"template": name}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or key in found:
            raise FormulaError(
                f"--template: {pair}: expected each argument once, as key=value; spaces need quotes: "
                "when='speed > 5'"
            )
        try:
            found[key] = tomllib.loads(f"v = {value}")["v"]
        except (ValueError, RecursionError):  # also integers of too many digits, and deep nesting
            found[key] = value
    return found
