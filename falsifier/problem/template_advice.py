"""Which template fits a requirement in words, by its words alone; for those without a language model.

Only English is understood. A template is proposed if it has a place for every number of the sentence, in the
unit of the signal that it is about; what the sentence does not say is left in capital letters. Nothing is
guessed: no number is in a proposal that is not in the sentence.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from falsifier.core.model import ModelInfo
from falsifier.fmu.description import Units, is_known
from falsifier.problem.template_arguments import tidy
from falsifier.problem.templates import TEMPLATES
from falsifier.problem.unit_check import factor_and_offset, spelled
from falsifier.stl.names import name_text

# Words that speak for a template, as regular expressions; those of more weight come first. In the text, @
# stands for a time, # for any other number and "# ~" for one per second or minute.
_WORDS = {
    "settles": (r"settl", r"converg", r"steady", r"within # .*@"),
    "overshoot": (r"overshoot", r"undershoot", r"exceeds? .*by (more than|at most)"),
    "rise": (r"\brise", r"\breach", r"\bget up to", r"\b(falls?|drops?) to\b"),
    "response": (
        r"\b(when(ever)?|if|each time)\b.*\b(within|after)", r"\bwithin\b.*\bwhen", r"follow",
        r"respon", r"react",
    ),
    "never_together": (
        r"never .*(together|both|same time|simultan)", r"not .*(both|at the same time)", r"exclusive",
    ),
    "dwell": (
        r"(stays?|remains?|holds?|lasts?|on|off|active) .*for at (least|most)", r"\bdwell", r"minimum time",
    ),
    "ramp_limit": (r"~", r"per (second|minute)", r"\brate\b", r"\bramp", r"\bchang\w+ by"),
    "order": (r"\bbefore\b", r"\bonly (once|after)", r"\bfirst\b.*\bthen\b", r"order"),
    "stays_within": (
        r"between", r"\b(below|under|above|over)\b", r"at (most|least)", r"exceed",
        r"(never|no|not) (more|less|higher|lower|greater|smaller)",
        r"within", r"\bmax", r"\bmin",
    ),
}  # fmt: skip

WHAT_CANNOT_BE_SAID = (
    "Formulas compare values of the same sample. A rate needs a signal that is the rate, or the template "
    'ramp_limit with over and range; "after each step" needs a level that the step crosses, such as '
    'after = "target > 50"; averages and earlier values need a signal of the model.'
)
_BEYOND = re.compile(
    r"\b(?:each|every|any|a) (?:step|jump|change)\b|\brates?\b|per (?:second|minute)|derivative|\bslope\b"
    r"|\baverage|\bmean\b|previous|earlier value"
)
ENGLISH_ONLY = (
    "without --llm NAME only English is understood, by its words; a language model understands any language. "
    "docs/requirements.md lists all templates"
)

# Numbers; those with a comma for decimals are read so that nothing takes their parts for numbers.
_NUMBER = re.compile(
    r"(?<![\w.,])[-+]?(?:\d{1,3}(?:,\d{3})+(?!\d)|\d+,\d+|\d+)(?:\.\d+)?(?:e[-+]?\d+)?", re.I
)
_UNIT = re.compile(r"\s*(%|per ?cent\b|(?:°|1/|/)?[^\W\d_]+(?:[/.^*·][^\W_]+)*)")
_PER = re.compile(r"\s+per\s+(second|minute|hour)\b", re.I)
# What joins two numbers of one unit.
_JOIN = re.compile(r"\s*(?:to|and|or|-|–)\s*", re.I)
_SECONDS = MappingProxyType({"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0})

# Comparisons, by what stands before a number.
_UPPER = (
    r"at most|no (?:more|higher|greater|larger|longer) than|up to|below|under|beneath"
    r"|(?:less|lower|smaller|slower) than|max(?:imum|imal)?"
)
_LOWER = (
    r"at least|no (?:less|lower|smaller|shorter) than|above|over|beyond"
    r"|(?:more|higher|greater|larger|faster) than|exceed\w*|min(?:imum|imal)?"
)
_COMPARED = re.compile(rf"\b(?:({_UPPER})|({_LOWER}))(?:\s+(?:of|is|the|a|value|limit|by))*\s*$", re.I)
_NEGATED = re.compile(r"\b(?:not|never|cannot|without|nor|neither)\b|n't\b", re.I)
# What begins a condition, and what begins an event in place of a state.
_CONDITIONAL = re.compile(
    r"\b(?:when(?:ever)?|if|while|once|until|unless|as long as|(?:each|every) time|before|after(?! *[#@]))\b",
    re.I,
)
# Words that say nothing of a signal, although its description may contain them.
_EMPTY = frozenset(
    ("and", "are", "for", "from", "has", "not", "off", "per", "than", "that", "the", "this", "with")
)
_EVENT = re.compile(r"\b(?:exceed\w*|ris\w+|f[ae]lls?|drops?|goes|climbs?|reach\w*)\b", re.I)


@dataclass(frozen=True, slots=True)
class Advice:
    """A template that may fit.

    Attributes:
        template: its name.
        summary: what it requires.
        section: a section of a spec with the numbers of the sentence; what is in capital letters has to be
            filled in.
    """

    template: str
    summary: str
    section: str


@dataclass(frozen=True, slots=True)
class _Quantity:
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


class _UnplacedError(Exception):
    """A number of the sentence has no place in a template."""


@dataclass(frozen=True, slots=True)
class _Sentence:
    """A sentence, its numbers, and the model that it is about."""

    text: str
    quantities: tuple[_Quantity, ...]
    info: ModelInfo
    units: Units

    @property
    def signal(self) -> str:
        """The signal, or expression of signals, that it is about; empty if it names none."""
        names, word = {v.name for v in (*self.info.outputs, *self.info.inputs)}, r"[\w.]*\w"
        for match in re.finditer(rf"{word}(?:\s*[-+*/]\s*{word})+", self.text):
            if {*re.findall(word, match[0])} <= names:
                return match[0]
        return next(iter(mentioned_signals(self.text, self.info)), "")

    def in_unit(self, q: _Quantity, *, is_difference: bool = False) -> str:
        """Return a number in the unit of the signal, as far as both are known.

        Raises:
            _UnplacedError: if it is of another kind.
        """
        first = next(iter(re.findall(r"[\w.]*\w", self.signal)), "")
        unit = self.info[first].unit if first in self.info else ""
        # Of a signal without a unit 5 % may be 5 or 0.05.
        if not q.unit or not self.signal or (not unit and q.unit != "%"):
            return f"{q.value:.12g}"
        found = factor_and_offset(q.unit, unit, self.units)
        if found is None:
            raise _UnplacedError
        return f"{tidy((q.value or 0.0) * found[0] + (0.0 if is_difference else found[1])):.12g}"


def hint(sentence: str) -> str:
    """Return what formulas cannot say, if a sentence may need that; else an empty text."""
    return WHAT_CANNOT_BE_SAID if _BEYOND.search(sentence.lower()) else ""


def advised_templates(
    sentence: str, info: ModelInfo, units: Units = MappingProxyType({}), *, most: int = 2
) -> list[Advice]:
    """Return the templates that fit a sentence, the best first; empty if there are none.

    Args:
        sentence: the requirement, in English.
        info: the model's signals.
        units: what the model says of its units.
        most: maximum number of templates.
    """
    quantities, marked = _read(sentence, info, units)
    said = _Sentence(sentence, quantities, info, units)
    scores = {name: _score(marked.lower(), words) for name, words in _WORDS.items()}
    is_conditional = bool(_CONDITIONAL.search(marked))
    found = []
    for name in sorted((name for name in scores if scores[name]), key=lambda name: -scores[name]):
        try:
            section = _section(name, said, is_conditional=is_conditional)
        except _UnplacedError:
            continue
        found.append(Advice(name, TEMPLATES[name].summary, section))
    return found[:most]


def mentioned_signals(sentence: str, info: ModelInfo) -> list[str]:
    """Return the signals whose names, or words of whose descriptions, occur in a sentence; best first."""
    words, whole = (
        set(re.findall(r"[a-z]{3,}", sentence.lower())) - _EMPTY,
        set(re.findall(r"[\w.]*\w", sentence)),
    )
    variables = [v for v in (*info.outputs, *info.inputs) if v.kind != "string"]
    named = {
        v.name: (v.name in whole) + 2 * len(words & _parts(v.name)) + len(words & _parts(v.description))
        for v in variables
    }
    return sorted((name for name in named if named[name]), key=lambda name: -named[name])


def _parts(name: str) -> set[str]:
    split = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return set(re.findall(r"[a-z]{3,}", split.lower()))


def _position(text: str, name: str) -> int:
    """Return where a sentence first names a signal, by its name or a part of it; its end if it does not."""
    places = (re.search(rf"\b{re.escape(word)}", text, re.I) for word in (name, *_parts(name)))
    return min((place.start() for place in places if place), default=len(text))


def _score(text: str, words: Iterable[str]) -> int:
    """Return how strongly words speak for a template: the first of its words counts most."""
    return max((10 - rank for rank, word in enumerate(words) if re.search(word, text)), default=0)


def _read(text: str, info: ModelInfo, units: Units) -> tuple[tuple[_Quantity, ...], str]:
    """Return the numbers of a sentence, and the sentence with marks in their places; see _WORDS."""
    own = {v.unit for v in info.variables if v.unit}
    found: list[_Quantity] = []
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
        found.append(_Quantity(value, unit, per, text[position : match.start()], end))
        marked += text[position : match.start()] + ("@" if _is_time(found[-1]) else "# ~" if per else "#")
        position = end
    for k in range(len(found) - 1, 0, -1):  # the unit of "from 5 to 10 s" belongs to both
        if not found[k - 1].unit and _JOIN.fullmatch(found[k].before):
            found[k - 1] = replace(found[k - 1], unit=found[k].unit, per=found[k].per)
    return tuple(found), marked + text[position:]


def _unit_at(text: str, start: int, own: set[str], units: Units) -> tuple[str, int] | None:
    """Return the unit that begins here, and where it ends; None if what follows is none."""
    match = _UNIT.match(text, start)
    if match is None:
        return None
    unit = match[1] if match[1] in own or is_known(match[1], units) else spelled(match[1])
    return (unit, match.end()) if unit in own or is_known(unit, units) else None


def _comparison(said: _Sentence, q: _Quantity) -> str:
    """Return the limit that a number is: ``low``, ``high``, or an empty text if the words do not say."""
    found = _COMPARED.search(q.before)
    if found is None:
        return ""
    before = q.before[: found.start()]
    earlier = [other for other in said.quantities if other.end < q.end]
    is_negated = bool(_NEGATED.search(before))
    if earlier and re.match(r"\s*(?:or|nor)\b", before):  # "must not exceed 3 or fall below 1"
        is_negated = is_negated or bool(_NEGATED.search(earlier[-1].before))
    if _EVENT.search(q.before) and not is_negated:
        return ""
    return "high" if (found[1] is not None) != is_negated else "low"


# -- where numbers belong -----------------------------------------------------------------------------------

_Rule = Callable[[_Sentence, _Quantity], bool]


def _is_time(q: _Quantity) -> bool:
    return q.unit in _SECONDS and not q.per


def _time(words: str) -> _Rule:
    return lambda _said, q: _is_time(q) and bool(re.search(rf"(?:{words})\s*$", q.before, re.I))


def _level(words: str) -> _Rule:
    return lambda _said, q: (
        not _is_time(q) and not q.per and bool(re.search(rf"(?:{words})\s*$", q.before, re.I))
    )


def _limit(side: str) -> _Rule:
    def fits(said: _Sentence, q: _Quantity) -> bool:
        if _is_time(q) or q.per:
            return False
        one = q if side == "low" else next((o for o in said.quantities[::-1] if o.end < q.end), q)
        is_other = one is q or bool(re.fullmatch(r"\s*(?:and|to)\s*", q.before, re.I))
        if is_other and side in ("low", "high") and re.search(r"\b(?:between|from)\s*$", one.before, re.I):
            return (one is q) == (side == "low")
        return _comparison(said, q) == side

    return fits


def _is_rate(_said: _Sentence, q: _Quantity) -> bool:
    return bool(q.per) or ("/" in q.unit and q.unit.rpartition("/")[2] in _SECONDS)


def _is_share_of(said: _Sentence, q: _Quantity) -> bool:
    return q.unit == "%" and not q.per and bool(re.match(r"\s+of\b", said.text[q.end :]))


_BY = r"within|in|after|at most|at the latest|no later than|by|less than|up to|(?:within|in) the first"
_WITHIN = r"within|by|±|\+/-|give or take|plus or minus"
_FOR = r"\bfor|\bfor at least"
# Of each template: its lines, with capital letters for what the sentence does not say; and for each argument
# which numbers it takes. A number takes the first that fits and is free.
_LINES: Mapping[str, Mapping[str, str]] = {
    "settles": {"signal": "{s0}", "reference": "REFERENCE", "within": "MARGIN", "time": "SECONDS"},
    "overshoot": {"signal": "{s0}", "reference": "REFERENCE", "at_most": "MARGIN"},
    "rise": {"signal": "{s0}", "reference": "REFERENCE", "reaches": '"100%"', "time": "SECONDS"},
    "response": {"when": '"{s0} > LEVEL"', "then": '"{s1} > LEVEL"', "time": "SECONDS"},
    "stays_within": {"signal": "{s0}"},
    "never_together": {"conditions": '["{s0} > LEVEL", "{s1} > LEVEL"]'},
    "dwell": {"condition": '"{s0} > LEVEL"'},
    "ramp_limit": {"signal": "{s0}", "limit": "PER_SECOND", "over": "SECONDS", "range": "[LOW, HIGH]"},
    "order": {"conditions": '["{s0} > LEVEL", "{s1} > LEVEL"]'},
}
_PLACES: Mapping[str, Mapping[str, _Rule]] = {
    "settles": {
        "within": _level(_WITHIN),
        "reference": _level(r"\b(?:to|at|of|near|around|reference|target)"),
        "stays": _time(_FOR),
        "time": _time(_BY),
    },
    "overshoot": {
        "at_most": _level(rf"{_UPPER}|by|more than|exceed"),
        "reference": _level(r"\b(?:of|above|over|to|reference|target|overshoots?|exceeds?|at)"),
        "duration": _time(r"\b(?:in|during|for|within)(?: the first)?"),
        "after": _time(r"\b(?:after|from)"),
    },
    "rise": {
        "reaches": _is_share_of,
        "reference": _level(r"\b(?:reach\w*|to|of|at least|above|beyond|through|value)"),
        "time": _time(_BY),
    },
    "response": {"stays": _time(_FOR), "time": _time(_BY)},
    "stays_within": {
        "within": _level(r"\bwithin|±|\+/-"),
        "reference": _level(r"\b(?:of|around)"),
        "low": _limit("low"),
        "high": _limit("high"),
        "end": _time(r"\bthe first|\buntil|\bup to|^\s*(?:and|to)"),
        "start": _time(r"\b(?:from|between|after)"),
    },
    "never_together": {},
    "dwell": {
        "at_least": _time(r"\b(?:at least|no (?:less|shorter) than|minimum(?: time)?(?: of| is)?)"),
        "at_most": _time(r"\b(?:at most|no (?:more|longer) than|up to|maximum(?: time)?(?: of| is)?)"),
    },
    "ramp_limit": {"limit": _is_rate},
    "order": {},
}
# Arguments that are margins: a percentage of the reference, or a number in the signal's unit.
_MARGINS = ("within", "at_most")
# Templates that apply after a condition, and the time that they then need.
_AFTER = {"settles": "stays", "overshoot": "duration", "rise": ""}
_DOWN = {"overshoot": r"undershoot", "rise": r"\b(?:fall|drop|decrease|sink)"}


def _section(template: str, said: _Sentence, *, is_conditional: bool) -> str:
    """Return the section of a spec for a template.

    Raises:
        _UnplacedError: if a number has no place in it, or the sentence has a condition and the template none.
    """
    if is_conditional and template in ("stays_within", "ramp_limit"):
        raise _UnplacedError
    lines = dict(_LINES[template]) | _numbers(template, said)
    if template in _AFTER and is_conditional:
        lines["after"] = '"CONDITION"'
        if _AFTER[template]:
            lines.setdefault(_AFTER[template], "SECONDS")
    if template in _DOWN and re.search(_DOWN[template], said.text, re.I):
        lines["direction"] = '"down"'
    if template == "stays_within":
        lines = _bounded(lines)
    elif template == "dwell" and len(lines) == 1:
        lines["at_least"] = "SECONDS"
    s0, s1 = _two_signals(template, said)
    if lines.get("reference") == "REFERENCE" and not is_conditional and s1 != "OTHER_SIGNAL":
        lines["reference"] = f'"{s1}"'
    lines = {key: value.format(s0=s0, s1=s1) for key, value in lines.items()}
    if "signal" in lines:
        lines["signal"] = f'"{s0}"'
    written = (f"{key} = {value}" for key, value in lines.items())
    return "\n".join(["[requirements.NAME]", f'template = "{template}"', *written])


def _numbers(template: str, said: _Sentence) -> dict[str, str]:
    """Return the numbers of the sentence by the argument that each belongs to."""
    found: dict[str, str] = {}
    for q in said.quantities:
        rules = _PLACES[template].items()
        key = next((key for key, fits in rules if key not in found and fits(said, q)), None)
        if key is None or q.value is None:
            raise _UnplacedError
        found[key] = _number(said, key, q)
    return found


def _number(said: _Sentence, key: str, q: _Quantity) -> str:
    """Return a number as the value of an argument."""
    if key == "limit":
        return _per_second(said, q)
    if _is_time(q):
        return f"{tidy((q.value or 0.0) * _SECONDS[q.unit]):.12g}"
    is_own = said.signal in said.info and spelled(said.info[said.signal].unit) == "%"
    if q.unit == "%" and (key == "reaches" or (key in _MARGINS and not is_own)):
        return f'"{q.value:g}%"'
    return said.in_unit(q, is_difference=key in _MARGINS)


def _bounded(lines: dict[str, str]) -> dict[str, str]:
    """Return the lines of stays_within: limits, or a margin around a reference; and when it applies."""
    start, end = lines.pop("start", ""), lines.pop("end", "")
    if "within" in lines or "reference" in lines:
        if "low" in lines or "high" in lines:
            raise _UnplacedError
        lines = {"reference": "REFERENCE", "within": "MARGIN"} | lines
    elif "low" not in lines and "high" not in lines:
        lines |= {"low": "LOW", "high": "HIGH"}
    elif "low" in lines and "high" in lines and float(lines["low"]) > float(lines["high"]):
        raise _UnplacedError
    during = {"during": f"[{start or 0}, {end or 'END'}]"} if start or end else {}
    return {"signal": lines.pop("signal")} | lines | during


def _per_second(said: _Sentence, q: _Quantity) -> str:
    """Return a rate as a change per second, in the signal's unit."""
    unit, _, per = (q.unit, "", q.per) if q.per else q.unit.rpartition("/")
    change = said.in_unit(replace(q, unit=unit, per=""), is_difference=True)
    return f"{tidy(float(change) / _SECONDS[per]):.12g}"


def _two_signals(template: str, said: _Sentence) -> tuple[str, str]:
    """Return the signals that a sentence names, as formulas and TOML have them; or placeholders."""
    names = [said.signal, *(n for n in mentioned_signals(said.text, said.info) if n != said.signal)][:2]
    if template in ("response", "order"):
        names = sorted(filter(None, names), key=lambda name: _position(said.text, name))
        text = said.text.lower()
        is_condition_last = re.search(r"\w.*\b(?:when(?:ever)?|if)\b", text) and not re.match(
            r"when|if", text
        )
        if is_condition_last if template == "response" else re.search(r"\bonly (?:once|after)\b", text):
            names.reverse()
    known = [name_text(n) if n in said.info else n for n in names if n]
    s0, s1 = [*known, *("SIGNAL", "OTHER_SIGNAL")[len(known) :]][:2]
    return tuple(n.replace("\\", "\\\\").replace('"', '\\"') for n in (s0, s1))  # type: ignore[return-value]
