"""What a sentence in English says in numbers: values, units, limits, and the signals that it names."""

import re
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

from falsifier.core.model import ModelInfo
from falsifier.fmu.description import Units, is_known
from falsifier.problem.template_arguments import tidy
from falsifier.problem.unit_check import factor_and_offset, spelled

# Numbers; those with a comma for decimals are read so that nothing takes their parts for numbers.
_NUMBER = re.compile(
    r"(?<![\w.,])[-+]?(?:\d{1,3}(?:,\d{3})+(?!\d)|\d+,\d+|\d+)(?:\.\d+)?(?:e[-+]?\d+)?", re.I
)
_UNIT = re.compile(r"\s*(%|per ?cent\b|(?:°|1/|/)?[^\W\d_]+(?:[/.^*·][^\W_]+)*)")
_PER = re.compile(r"\s+per\s+(second|minute|hour)\b", re.I)
# What joins two numbers of one unit.
_JOIN = re.compile(r"\s*(?:to|and|or|-|–)\s*", re.I)
SECONDS = MappingProxyType({"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0})

# Comparisons, by what stands before a number.
UPPER = (
    r"at most|no (?:more|higher|greater|larger|longer) than|up to|below|under|beneath"
    r"|(?:less|lower|smaller|slower) than|max(?:imum|imal)?"
)
_LOWER = (
    r"at least|no (?:less|lower|smaller|shorter) than|above|over|beyond"
    r"|(?:more|higher|greater|larger|faster) than|exceed\w*|min(?:imum|imal)?"
)
_COMPARED = re.compile(rf"\b(?:({UPPER})|({_LOWER}))(?:\s+(?:of|is|the|a|value|limit|by))*\s*$", re.I)
_BETWEEN = re.compile(r"\b(?:between|from)\s*$", re.I)
_NEGATED = re.compile(r"\b(?:not|never|cannot|without|nor|neither)\b|n't\b", re.I)
_EVENT = re.compile(r"\b(?:exceed\w*|ris\w+|f[ae]lls?|drops?|goes|climbs?|reach\w*)\b", re.I)

# A signal's name, also with dots.
_WORD = r"[\w.]*\w"
# Words that say nothing of a signal, although its description may contain them.
_EMPTY = frozenset(
    ("and", "are", "for", "from", "has", "not", "off", "per", "than", "that", "the", "this", "with")
)


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of a sentence.

    Attributes:
        value: the number; None if it cannot be read.
        unit: its unit; empty if none is stated.
        per: the unit of time that it is per.
        before: what stands before it, from the number before.
        end: where it ends.
    """

    value: float | None
    unit: str
    per: str
    before: str
    end: int

    @property
    def is_time(self) -> bool:
        """Whether it is a time."""
        return self.unit in SECONDS and not self.per


class UnplacedError(Exception):
    """A number of the sentence has no place in a template."""


@dataclass(frozen=True, slots=True)
class Sentence:
    """A sentence, its numbers, and the model that it is about.

    Attributes:
        text: the sentence.
        marked: the sentence with its numbers replaced: times by ``@``, others by ``#``, those per second or
            minute by ``# ~``.
        quantities: its numbers.
        info: the model's signals.
        units: what the model says of its units.
    """

    text: str
    marked: str
    quantities: tuple[Quantity, ...]
    info: ModelInfo
    units: Units

    @property
    def signal(self) -> str:
        """The signal, or expression of signals, that it is about; empty if it names none."""
        names = {v.name for v in (*self.info.outputs, *self.info.inputs)}
        for match in re.finditer(rf"{_WORD}(?:\s*[-+*/]\s*{_WORD})+", self.text):
            if {*re.findall(_WORD, match[0])} <= names:
                return match[0]
        return next(iter(mentioned_signals(self.text, self.info)), "")

    def in_unit(self, q: Quantity, *, is_difference: bool = False) -> str:
        """Return a number in the unit of the signal, as far as both are known.

        Raises:
            UnplacedError: if it is of another kind.
        """
        first = next(iter(re.findall(_WORD, self.signal)), "")
        unit = self.info[first].unit if first in self.info else ""
        # Of a signal without a unit 5 % may be 5 or 0.05.
        if not q.unit or not self.signal or (not unit and q.unit != "%"):
            return f"{q.value:.12g}"
        found = factor_and_offset(q.unit, unit, self.units)
        if found is None:
            raise UnplacedError
        return f"{tidy((q.value or 0.0) * found[0] + (0.0 if is_difference else found[1])):.12g}"

    def limit(self, q: Quantity) -> Literal["low", "high", ""]:
        """Return which limit a number is; an empty text if the words do not say."""
        previous = next((other for other in self.quantities[::-1] if other.end < q.end), None)
        if _BETWEEN.search(q.before):
            return "low"
        if (
            previous
            and re.fullmatch(r"\s*(?:and|to)\s*", q.before, re.I)
            and _BETWEEN.search(previous.before)
        ):
            return "high"
        found = _COMPARED.search(q.before)
        if found is None:
            return ""
        before = q.before[: found.start()]
        is_negated = bool(_NEGATED.search(before))
        if previous and re.match(r"\s*(?:or|nor)\b", before):  # "must not exceed 3 or fall below 1"
            is_negated = is_negated or bool(_NEGATED.search(previous.before))
        if _EVENT.search(q.before) and not is_negated:
            return ""
        return "high" if (found[1] is not None) != is_negated else "low"


def mentioned_signals(sentence: str, info: ModelInfo) -> list[str]:
    """Return the signals whose names, or words of whose descriptions, occur in a sentence; best first."""
    words, whole = _parts(sentence.lower()) - _EMPTY, set(re.findall(_WORD, sentence))
    named = {
        v.name: (v.name in whole) + 2 * len(words & _parts(v.name)) + len(words & _parts(v.description))
        for v in (*info.outputs, *info.inputs)
        if v.kind != "string"
    }
    return sorted((name for name in named if named[name]), key=lambda name: -named[name])


def _parts(name: str) -> set[str]:
    split = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return set(re.findall(r"[a-z]{3,}", split.lower()))


def position_of(text: str, name: str) -> int:
    """Return where a sentence first names a signal, by its name or a part of it; its end if it does not."""
    places = (re.search(rf"\b{re.escape(word)}", text, re.I) for word in (name, *_parts(name)))
    return min((place.start() for place in places if place), default=len(text))


def read_sentence(text: str, info: ModelInfo, units: Units) -> Sentence:
    """Return a sentence with its numbers."""
    own = {v.unit for v in info.variables if v.unit}
    found: list[Quantity] = []
    marked, position = "", 0
    for match in _NUMBER.finditer(text):
        if match.start() < position:  # within a unit, such as 1/min
            continue
        digits, end, unit, per = match[0], match.end(), "", ""
        if known := _unit_at(text, end, own, units):
            unit, end = known
        if time := _PER.match(text, end):
            per, end = spelled(time[1].lower()), time.end()
            if is_known(spelled(f"{unit}/{per}"), units):
                unit, per = spelled(f"{unit}/{per}"), ""
        is_number = "," not in digits or re.fullmatch(r"[-+]?\d{1,3}(?:,\d{3})+(?:\.\d+)?", digits)
        is_part = not known and re.match(r"\w", text[end:])  # an ordinal, say
        value = float(digits.replace(",", "")) if is_number and not is_part else None
        found.append(Quantity(value, unit, per, text[position : match.start()], end))
        marked += found[-1].before + ("@" if found[-1].is_time else "# ~" if per else "#")
        position = end
    for k in range(len(found) - 1, 0, -1):  # the unit of "from 5 to 10 s" belongs to both
        if not found[k - 1].unit and _JOIN.fullmatch(found[k].before):
            found[k - 1] = replace(found[k - 1], unit=found[k].unit, per=found[k].per)
    return Sentence(text, marked + text[position:], tuple(found), info, units)


def _unit_at(text: str, start: int, own: set[str], units: Units) -> tuple[str, int] | None:
    """Return the unit that begins here, and where it ends; None if what follows is none."""
    match = _UNIT.match(text, start)
    if match is None:
        return None
    unit = match[1] if match[1] in own or is_known(match[1], units) else spelled(match[1])
    return (unit, match.end()) if unit in own or is_known(unit, units) else None
