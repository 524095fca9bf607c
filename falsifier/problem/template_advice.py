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
from falsifier.fmu.description import Units
from falsifier.problem.sentence import (
    SECONDS,
    UPPER,
    Quantity,
    Sentence,
    UnplacedError,
    comparison,
    is_time,
    mentioned_signals,
    position_of,
    read_sentence,
)
from falsifier.problem.template_arguments import tidy
from falsifier.problem.templates import TEMPLATES
from falsifier.problem.unit_check import spelled
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

# What begins a condition, and what begins an event in place of a state.
_CONDITIONAL = re.compile(
    r"\b(?:when(?:ever)?|if|while|once|until|unless|as long as|(?:each|every) time|before|after(?! *[#@]))\b",
    re.I,
)


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
    said, marked = read_sentence(sentence, info, units)
    scores = {name: _score(marked.lower(), words) for name, words in _WORDS.items()}
    is_conditional = bool(_CONDITIONAL.search(marked))
    found = []
    for name in sorted((name for name in scores if scores[name]), key=lambda name: -scores[name]):
        try:
            section = _section(name, said, is_conditional=is_conditional)
        except UnplacedError:
            continue
        found.append(Advice(name, TEMPLATES[name].summary, section))
    return found[:most]


def _score(text: str, words: Iterable[str]) -> int:
    """Return how strongly words speak for a template: the first of its words counts most."""
    return max((10 - rank for rank, word in enumerate(words) if re.search(word, text)), default=0)


# -- where numbers belong -----------------------------------------------------------------------------------

_Rule = Callable[[Sentence, Quantity], bool]


def _time(words: str) -> _Rule:
    return lambda _said, q: is_time(q) and bool(re.search(rf"(?:{words})\s*$", q.before, re.I))


def _level(words: str) -> _Rule:
    return lambda _said, q: (
        not is_time(q) and not q.per and bool(re.search(rf"(?:{words})\s*$", q.before, re.I))
    )


def _limit(side: str) -> _Rule:
    def fits(said: Sentence, q: Quantity) -> bool:
        if is_time(q) or q.per:
            return False
        one = q if side == "low" else next((o for o in said.quantities[::-1] if o.end < q.end), q)
        is_other = one is q or bool(re.fullmatch(r"\s*(?:and|to)\s*", q.before, re.I))
        if is_other and side in ("low", "high") and re.search(r"\b(?:between|from)\s*$", one.before, re.I):
            return (one is q) == (side == "low")
        return comparison(said, q) == side

    return fits


def _is_rate(_said: Sentence, q: Quantity) -> bool:
    return bool(q.per) or ("/" in q.unit and q.unit.rpartition("/")[2] in SECONDS)


def _is_share_of(said: Sentence, q: Quantity) -> bool:
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
        "at_most": _level(rf"{UPPER}|by|more than|exceed"),
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


def _section(template: str, said: Sentence, *, is_conditional: bool) -> str:
    """Return the section of a spec for a template.

    Raises:
        UnplacedError: if a number has no place in it, or the sentence has a condition and the template none.
    """
    if is_conditional and template in ("stays_within", "ramp_limit"):
        raise UnplacedError
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


def _numbers(template: str, said: Sentence) -> dict[str, str]:
    """Return the numbers of the sentence by the argument that each belongs to."""
    found: dict[str, str] = {}
    for q in said.quantities:
        rules = _PLACES[template].items()
        key = next((key for key, fits in rules if key not in found and fits(said, q)), None)
        if key is None or q.value is None:
            raise UnplacedError
        found[key] = _number(said, key, q)
    return found


def _number(said: Sentence, key: str, q: Quantity) -> str:
    """Return a number as the value of an argument."""
    if key == "limit":
        return _per_second(said, q)
    if is_time(q):
        return f"{tidy((q.value or 0.0) * SECONDS[q.unit]):.12g}"
    is_own = said.signal in said.info and spelled(said.info[said.signal].unit) == "%"
    if q.unit == "%" and (key == "reaches" or (key in _MARGINS and not is_own)):
        return f'"{q.value:g}%"'
    return said.in_unit(q, is_difference=key in _MARGINS)


def _bounded(lines: dict[str, str]) -> dict[str, str]:
    """Return the lines of stays_within: limits, or a margin around a reference; and when it applies."""
    start, end = lines.pop("start", ""), lines.pop("end", "")
    if "within" in lines or "reference" in lines:
        if "low" in lines or "high" in lines:
            raise UnplacedError
        lines = {"reference": "REFERENCE", "within": "MARGIN"} | lines
    elif "low" not in lines and "high" not in lines:
        lines |= {"low": "LOW", "high": "HIGH"}
    elif "low" in lines and "high" in lines and float(lines["low"]) > float(lines["high"]):
        raise UnplacedError
    during = {"during": f"[{start or 0}, {end or 'END'}]"} if start or end else {}
    return {"signal": lines.pop("signal")} | lines | during


def _per_second(said: Sentence, q: Quantity) -> str:
    """Return a rate as a change per second, in the signal's unit."""
    unit, _, per = (q.unit, "", q.per) if q.per else q.unit.rpartition("/")
    change = said.in_unit(replace(q, unit=unit, per=""), is_difference=True)
    return f"{tidy(float(change) / SECONDS[per]):.12g}"


def _two_signals(template: str, said: Sentence) -> tuple[str, str]:
    """Return the signals that a sentence names, as formulas and TOML have them; or placeholders."""
    names = [said.signal, *(n for n in mentioned_signals(said.text, said.info) if n != said.signal)][:2]
    if template in ("response", "order"):
        names = sorted(filter(None, names), key=lambda name: position_of(said.text, name))
        text = said.text.lower()
        is_condition_last = re.search(r"\w.*\b(?:when(?:ever)?|if)\b", text) and not re.match(
            r"when|if", text
        )
        if is_condition_last if template == "response" else re.search(r"\bonly (?:once|after)\b", text):
            names.reverse()
    known = [name_text(n) if n in said.info else n for n in names if n]
    s0, s1 = [*known, *("SIGNAL", "OTHER_SIGNAL")[len(known) :]][:2]
    return tuple(n.replace("\\", "\\\\").replace('"', '\\"') for n in (s0, s1))  # type: ignore[return-value]
