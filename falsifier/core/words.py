"""Candidates and tables as text: the same on terminals, in notebooks, reports and messages to an LLM."""

from collections.abc import Collection, Iterable, Sequence
from math import inf, log10
from typing import Literal

from falsifier.core.candidate import Candidate
from falsifier.core.literals import digits
from falsifier.core.ranges import InputRange, number_names
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace

# Maximum number of control points shown; longer signals are abbreviated in the middle.
_SHOWN_POINTS = 12
# Digits that all decimal numbers keep in a float, and those that tell any two floats apart.
_EXACT_DIGITS, _MOST_DIGITS = 15, 17


def with_unit(name: str, unit: str) -> str:
    """Return a name with its unit, if that is known, as in headers of tables and labels of axes."""
    return f"{name} [{unit}]" if unit not in ("", "1") else name


def in_unit(number: str, unit: str) -> str:
    """Return a number with its unit, if that is known and has a name.

    >>> in_unit("3", "m/s"), in_unit("3", ""), in_unit("3", "1")
    ('3 m/s', '3', '3')
    """
    return f"{number} {unit}" if unit not in ("", "1") else number


def readable(value: float, digits: int = 6, sign: Literal["", "+"] = "") -> str:
    """Return a number with so many digits, a large one with its hundredths, a whole one with all digits.

    Beyond 2^53, from where on all are whole, it has ten; with more than 15 digits it is the shortest text
    that has the value. The sign "+" is for numbers above zero, too.

    >>> readable(1000000000000040.0), readable(1 / 3), readable(50 / 3, 4), readable(86399.95, 4, "+")
    ('1000000000000040', '0.333333', '16.67', '+86399.95')
    """
    if digits > _EXACT_DIGITS:
        return f"{value:{sign}}".removesuffix(".0")
    whole = 16 if abs(value) <= 2**53 else 10
    least = whole if float(value).is_integer() else min(10, len(f"{value:.0f}") + 2)
    return f"{value:{sign}.{max(digits, least)}g}"


def resolving(value: float, difference: float, least: int = 6) -> int:
    """Return how many digits of a number show a difference of this size; not fewer than usual.

    >>> resolving(3.0, 0.5), resolving(1000000.0005, 0.001), resolving(0.1 + 0.2, 1e-16)
    (6, 11, 17)
    """
    ratio = abs(value / difference) if difference else 0.0
    return max(least, min(int(log10(ratio)) + 2, _MOST_DIGITS)) if 0.0 < ratio < inf else least


def choosing(value: float, difference: float, least: int) -> int:
    """Return how many digits tell a chosen number: all if it was written or rounded, else as ``resolving``.

    >>> choosing(1000000.0005, 1.0, 6), choosing(0.1 + 0.2, 0.001, 6)
    (11, 6)
    """
    written = digits(value)
    return max(written, least) if written <= _EXACT_DIGITS else resolving(value, difference, least)


def ends(low: float, high: float) -> tuple[str, str]:
    """Return both ends of a range, with digits that show a hundredth of it.

    >>> ends(0.0, 100.0), ends(999999.999, 1000000.001)
    (('0', '100'), ('999999.999', '1000000.001'))
    """
    needed = resolving(max(abs(low), abs(high)), (high - low) / 100.0)
    return readable(low, needed), readable(high, needed)


def candidate_facts(candidate: Candidate, space: SearchSpace | None = None) -> list[tuple[str, str]]:
    """Return what a candidate chooses, inputs first: ``input`` or ``parameter``, and the choice in words.

    Units, and the names of parameters' numbers, are told if the search space is given, which has them.
    """
    ranges = {r.name: r for r in space.ranges} if space is not None else {}
    labels = {r.name: with_unit(r.name, r.unit) for r in ranges.values()}
    names = {r.name: number_names(r.kind, r.items) for r in space.parameters} if space is not None else {}
    chosen = {n: (v, names.get(n, {}).get(int(v))) for n, v in candidate.parameters.items()}
    signals = {n: s.stepped(inf if space is None else space.stop_time) for n, s in candidate.signals.items()}

    def needed(name: str, value: float, least: int) -> int:
        width = ranges[name].high - ranges[name].low if name in ranges else 0.0
        return choosing(value, width / 10_000.0, least)

    told = {n: signal_text(s, needed(n, s.values[0], 6)) for n, s in signals.items()}
    facts = [("input", f"{labels.get(n, n)} {text}") for n, text in told.items()]
    for n, (v, name) in chosen.items():
        value = readable(v, needed(n, v, 10))
        facts.append(("parameter", f"{labels.get(n, n)} = {value}{f' ({name})' if name else ''}"))
    return facts


def in_one_line(candidate: Candidate, space: SearchSpace | None = None) -> str:
    """Return a candidate in one line, with units and names as above."""
    return "; ".join(text for _, text in candidate_facts(candidate, space))


def named(number: str, kind: str, items: Iterable[tuple[str, int]]) -> str:
    """Return a whole number and its name, if it is one of a Boolean or an enumeration.

    >>> named("1", "boolean", ()), named("2", "integer", ())
    ('1 = true', '2')
    """
    names = {str(n): name for n, name in number_names(kind, items).items()}
    return f"{number} = {names[number]}" if number in names else number


def signal_text(signal: Signal, digits: int = 6) -> str:
    """Return the control points of a signal, its number of switches and its shortest dwell.

    Switches and dwell help the reader judge whether the signal is plausible on the real system. Values and
    times that are close to each other have more digits than usual; a constant has so many.

    >>> signal_text(Signal((0.0, 2.5), (100.0, 0.0), "constant"))
    'held: 100 at 0 s, 0 at 2.5 s (1 switch)'
    >>> signal_text(Signal((0.0,), (3.0,)))
    'constant 3'
    """
    if len(set(signal.values)) == 1:
        return f"constant {readable(signal.values[0], digits)}"
    dwell = signal.shortest_dwell
    change, pause = (max(signal.values) - min(signal.values)) / 1000.0, (dwell or 0.0) / 10.0
    points = [
        f"{readable(v, resolving(v, change))} at {readable(t, resolving(t, pause, 4))} s"
        for t, v in zip(signal.times, signal.values, strict=True)
    ]
    if len(points) > _SHOWN_POINTS:
        half = _SHOWN_POINTS // 2
        points = [*points[:half], f"... {len(points) - 2 * half} more ...", *points[-half:]]
    lively = "" if dwell is None else f", shortest dwell {readable(dwell, 4)} s"
    form = "held" if signal.interpolation == "constant" else signal.interpolation
    return f"{form}: {', '.join(points)} ({counted(signal.switches, 'switch')}{lively})"


def parameterization_text(r: InputRange) -> str:
    """Return how an input may be built.

    >>> parameterization_text(InputRange("u", 0.0, 1.0, control_points=5))
    '(5 control points, pchip)'
    """
    held = "" if r.hold is None else f", each held for {readable(r.hold)} s"
    if r.free is None:
        return f"({counted(r.control_points, 'control point')}, {r.interpolation}{held})"
    most = counted(r.free.max_control_points, "control point")
    return f"(free: at most {most}, at least {readable(r.free.min_interval)} s apart{held})"


def counted(count: int, noun: str) -> str:
    """Return a count and its noun, in the singular or plural.

    >>> counted(1, "switch"), counted(2, "switch"), counted(0, "simulation"), counted(2, "reply")
    ('1 switch', '2 switches', '0 simulations', '2 replies')
    """
    if noun.endswith("ly"):  # reply
        return f"{count} {noun if count == 1 else noun[:-1] + 'ies'}"
    plural = f"{noun}es" if noun.endswith(("ch", "sh", "s", "x")) else f"{noun}s"
    return f"{count} {noun if count == 1 else plural}"


def listed(parts: Sequence[str]) -> str:
    """Join parts as in a sentence.

    >>> listed(["a"]), listed(["a", "b", "c"])
    ('a', 'a, b and c')
    """
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def first_few(parts: Sequence[str], most: int = 10, *, between: str = ", ") -> str:
    """Name the first parts, and say how many more there are.

    >>> first_few(["a", "b"]), first_few(["a", "b", "c"], most=1)
    ('a, b', 'a and 2 more')
    """
    more = f" and {len(parts) - most} more" if len(parts) > most else ""
    return f"{between.join(parts[:most])}{more}"


def aligned(
    rows: Iterable[Sequence[str]], *, right: Collection[int] = (), widest: int | None = None
) -> list[str]:
    """Return the rows of a table as lines with aligned columns, those of some numbers aligned right.

    Cells longer than the widest column push the rest of their row to the right.
    """
    rows = list(rows)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    if widest is not None:
        widths = [min(width, widest) for width in widths]
    lines = []
    for row in rows:
        cells = enumerate(zip(row, widths, strict=True))
        padded = (cell.rjust(w) if k in right else cell.ljust(w) for k, (cell, w) in cells)
        lines.append("  ".join(padded).rstrip())
    return lines


def without_full_stop(text: str) -> str:
    """Return a text that others follow, without the full stop at its end; three of them are kept.

    >>> without_full_stop("It ends."), without_full_stop("and so on ...")
    ('It ends', 'and so on ...')
    """
    return text[:-1] if text.endswith(".") and not text.endswith("..") else text


def shortened(text: str, most: int) -> str:
    """Return a text; of one with more characters than this the beginning, marked as such.

    >>> shortened("a short text", 20), shortened("a long text", 6)
    ('a short text', 'a long ...')
    """
    return text if len(text) <= most else f"{text[:most]} ..."
