"""Which template fits a requirement in words, by its words alone; for those without a language model.

Only English is understood. A template is proposed if it has a place for every number of the sentence, in the
unit of the signal that it is about; what the sentence does not say is left in capital letters. Nothing is
guessed: no number is in a proposal that is not in the sentence.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

from falsifier.core.model import ModelInfo
from falsifier.fmu.description import Units
from falsifier.problem.sentence import (
    SECONDS,
    UPPER,
    Quantity,
    Sentence,
    UnplacedError,
    mentioned_signals,
    position_of,
    read_sentence,
)
from falsifier.problem.template_arguments import tidy
from falsifier.problem.templates import TEMPLATES
from falsifier.problem.unit_check import spelled
from falsifier.stl.lexer import name_text

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


class _Shape(NamedTuple):
    """How sentences for one template look.

    Attributes:
        words: regular expressions that speak for it; the first ones most. In the text, @ stands for a time,
            # for any other number and "# ~" for one per second or minute.
        lines: its arguments, with capital letters for what the sentence does not say.
        places: which numbers each argument takes, by their kind and what stands before them; a number takes
            the first place that fits and is free. Kinds: ``time``; ``level``, any other number; ``low`` or
            ``high``, a level that the words make this limit; ``rate``; ``share``, a percentage of something.
        after: argument that it needs as well if it applies after a condition; empty: none, None: it has no
            place for a condition beside those that it is about.
        down: words with which it is about falling.
    """

    words: tuple[str, ...]
    lines: Mapping[str, str]
    places: Mapping[str, tuple[str, str]]
    after: str | None = None
    down: str = ""


_BY = r"within|in|after|at most|at the latest|no later than|by|less than|up to|(?:within|in) the first"
_FOR = r"\bfor|\bfor at least"
_SHAPES: Mapping[str, _Shape] = {
    "settles": _Shape(
        (r"settl", r"converg", r"steady", r"within # .*@"),
        {"signal": "{s0}", "reference": "REFERENCE", "within": "MARGIN", "time": "SECONDS"},
        {
            "within": ("level", r"within|by|±|\+/-|give or take|plus or minus"),
            "reference": ("level", r"\b(?:to|at|of|near|around|reference|target)"),
            "stays": ("time", _FOR),
            "time": ("time", _BY),
        },
        after="stays",
    ),
    "overshoot": _Shape(
        (r"overshoot", r"undershoot", r"exceeds? .*by (more than|at most)"),
        {"signal": "{s0}", "reference": "REFERENCE", "at_most": "MARGIN"},
        {
            "at_most": ("level", rf"{UPPER}|by|more than|exceed"),
            "reference": ("level", r"\b(?:of|above|over|to|reference|target|overshoots?|exceeds?|at)"),
            "duration": ("time", r"\b(?:in|during|for|within)(?: the first)?"),
            "after": ("time", r"\b(?:after|from)"),
        },
        after="duration",
        down=r"undershoot",
    ),
    "rise": _Shape(
        (r"\brise", r"\breach", r"\bget up to", r"\b(falls?|drops?) to\b"),
        {"signal": "{s0}", "reference": "REFERENCE", "reaches": '"100%"', "time": "SECONDS"},
        {
            "reaches": ("share", ""),
            "reference": ("level", r"\b(?:reach\w*|to|of|at least|above|beyond|through|value)"),
            "time": ("time", _BY),
        },
        after="",
        down=r"\b(?:fall|drop|decrease|sink)",
    ),
    "response": _Shape(
        (r"\b(when(ever)?|if|each time)\b.*\b(within|after)", r"\bwithin\b.*\bwhen", r"follow|respon|react"),
        {"when": '"{s0} > LEVEL"', "then": '"{s1} > LEVEL"', "time": "SECONDS"},
        {"stays": ("time", _FOR), "time": ("time", _BY)},
    ),
    "never_together": _Shape(
        (r"never .*(together|both|same time|simultan)", r"not .*(both|at the same time)", r"exclusive"),
        {"conditions": '["{s0} > LEVEL", "{s1} > LEVEL"]'},
        {},
    ),
    "dwell": _Shape(
        (r"(stays?|remains?|holds?|lasts?|on|off|active) .*for at (least|most)", r"\bdwell", r"minimum time"),
        {"condition": '"{s0} > LEVEL"'},
        {
            "at_least": ("time", r"\b(?:at least|no (?:less|shorter) than|minimum(?: time)?(?: of| is)?)"),
            "at_most": ("time", r"\b(?:at most|no (?:more|longer) than|up to|maximum(?: time)?(?: of| is)?)"),
        },
    ),
    "ramp_limit": _Shape(
        (r"~", r"per (second|minute)", r"\brate\b", r"\bramp", r"\bchang\w+ by"),
        {"signal": "{s0}", "limit": "PER_SECOND", "over": "SECONDS", "range": "[LOW, HIGH]"},
        {"limit": ("rate", "")},
    ),
    "order": _Shape(
        (r"\bbefore\b", r"\bonly (once|after)", r"\bfirst\b.*\bthen\b", r"order"),
        {"conditions": '["{s0} > LEVEL", "{s1} > LEVEL"]'},
        {},
    ),
    "stays_within": _Shape(
        (r"between", r"\b(below|under|above|over)\b", r"at (most|least)", r"exceed",
         r"(never|no|not) (more|less|higher|lower|greater|smaller)", r"within", r"\bmax", r"\bmin"),
        {"signal": "{s0}"},
        {
            "within": ("level", r"\bwithin|±|\+/-"),
            "reference": ("level", r"\b(?:of|around)"),
            "low": ("low", ""),
            "high": ("high", ""),
            "end": ("time", r"\bthe first|\buntil|\bup to|^\s*(?:and|to)"),
            "start": ("time", r"\b(?:from|between|after)"),
        },
    ),
}  # fmt: skip
# Arguments that are margins: a percentage of the reference, or a number in the signal's unit.
_MARGINS = ("within", "at_most")


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
    said = read_sentence(sentence, info, units)
    text, is_conditional = said.marked.lower(), bool(_CONDITIONAL.search(said.marked))
    ranks = {  # of the first of a template's words that occurs
        name: min(rank for rank, word in enumerate(shape.words) if re.search(word, text))
        for name, shape in _SHAPES.items()
        if any(re.search(word, text) for word in shape.words)
    }
    found = []
    for name in sorted(ranks, key=ranks.__getitem__):
        try:
            section = _section(name, said, is_conditional=is_conditional)
        except UnplacedError:
            continue
        found.append(Advice(name, TEMPLATES[name].summary, section))
    return found[:most]


def _section(template: str, said: Sentence, *, is_conditional: bool) -> str:
    """Return the section of a spec for a template.

    Raises:
        UnplacedError: if a number has no place in it, or the sentence has a condition and the template none.
    """
    shape = _SHAPES[template]
    lines = dict(shape.lines) | _numbers(shape, said)
    if is_conditional and "signal" in lines:  # other templates are about conditions
        if shape.after is None:
            raise UnplacedError
        lines["after"] = '"CONDITION"'
        if shape.after:
            lines.setdefault(shape.after, "SECONDS")
    if shape.down and re.search(shape.down, said.text, re.I):
        lines["direction"] = '"down"'
    if template == "stays_within":
        lines = _bounded(lines)
    elif template == "dwell" and len(lines) == 1:
        lines["at_least"] = "SECONDS"
    s0, s1 = _two_signals(template, said)
    if lines.get("reference") == "REFERENCE" and not is_conditional and s1 != "OTHER_SIGNAL":
        lines["reference"] = f'"{s1}"'
    if "signal" in lines:
        lines["signal"] = f'"{s0}"'
    written = (f"{key} = {value.replace('{s0}', s0).replace('{s1}', s1)}" for key, value in lines.items())
    return "\n".join(["[requirements.NAME]", f'template = "{template}"', *written])


def _numbers(shape: _Shape, said: Sentence) -> dict[str, str]:
    """Return the numbers of the sentence by the argument that each belongs to."""
    found: dict[str, str] = {}
    for q in said.quantities:
        places = shape.places.items()
        key = next((key for key, where in places if key not in found and _fits(*where, said, q)), None)
        if key is None or q.value is None:
            raise UnplacedError
        found[key] = _number(said, key, q)
    return found


def _fits(kind: str, words: str, said: Sentence, q: Quantity) -> bool:
    """Whether a place takes a number."""
    if kind == "rate":
        return bool(q.per) or ("/" in q.unit and q.unit.rpartition("/")[2] in SECONDS)
    if q.per or q.is_time != (kind == "time"):
        return False
    if kind == "share":
        return q.unit == "%" and bool(re.match(r"\s+of\b", said.text[q.end :]))
    if kind in ("low", "high"):
        return said.limit(q) == kind
    return bool(re.search(rf"(?:{words})\s*$", q.before, re.I))


def _number(said: Sentence, key: str, q: Quantity) -> str:
    """Return a number as the value of an argument."""
    value = q.value or 0.0
    if key == "limit":  # a change per second, in the signal's unit
        unit, _, per = (q.unit, "", q.per) if q.per else q.unit.rpartition("/")
        change = said.in_unit(replace(q, unit=unit, per=""), is_difference=True)
        return f"{tidy(float(change) / SECONDS[per]):.12g}"
    if q.is_time:
        return f"{tidy(value * SECONDS[q.unit]):.12g}"
    is_own = said.signal in said.info and spelled(said.info[said.signal].unit) == "%"
    if q.unit == "%" and (key == "reaches" or (key in _MARGINS and not is_own)):
        return f'"{value:g}%"'
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
    s0, s1, *_ = [*known, *("SIGNAL", "OTHER_SIGNAL")[len(known) :]]
    return _escaped(s0), _escaped(s1)


def _escaped(name: str) -> str:
    """Return a name as it stands within a string of TOML."""
    return name.replace("\\", "\\\\").replace('"', '\\"')
