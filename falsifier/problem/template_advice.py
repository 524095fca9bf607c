"""Which template a requirement in words is, for those without a language model.

A sentence in English has to be one of the forms below as a whole, each number in its place and in a unit that
converts to the signal's. So nothing is guessed and nothing left out; what a form does not say is in capital
letters.
"""

import re
from dataclasses import dataclass
from types import MappingProxyType

from falsifier.core.literals import toml_string
from falsifier.core.model import ModelInfo
from falsifier.fmu.description.structure import Units, is_known
from falsifier.problem.template_arguments import tidy
from falsifier.problem.templates import TEMPLATES
from falsifier.problem.unit_check import factor_and_offset, spelled
from falsifier.stl.lexer import name_text


@dataclass(frozen=True, slots=True)
class Advice:
    """A template that fits a sentence.

    Attributes:
        template: its name.
        summary: what it requires.
        section: a section of a spec with the numbers of the sentence; what is in capital letters has to be
            filled in.
    """

    template: str
    summary: str
    section: str


# -- the forms of sentences ----------------------------------------------------------------------------------

_IS = r"(?:(?:must|should|shall) )?(?:always )?(?:is|are|be|stays?|remains?|lies?)"
_NEVER = r"(?:must not|should not|shall not|may not|cannot|does not|do not|never|must never)"
_AT_MOST = rf"(?:{_IS} (?:at most|below|under|no (?:more|higher) than|less than|never (?:above|over))"
_AT_MOST += rf"|{_NEVER} (?:exceeds?|(?:goes?|rises?|gets?|is|be) (?:above|over)))"
_AT_LEAST = rf"(?:{_IS} (?:at least|above|over|no (?:less|lower) than|more than|never (?:below|under))"
_AT_LEAST += rf"|{_NEVER} (?:(?:goes?|falls?|drops?|gets?|is|be) (?:below|under)))"
_WITHIN = r"(?:within|in|in at most|in less than|after at most)"
_DURING = r"(?:(?: (?:in|for|during) the first| until| from <time start> to) <time end>)?"
_AFTER = r"(?: (?:after|when|whenever|once) <event after>)?"
_WHENEVER = r"(?:when|whenever|if|each time|every time)"

# Forms of sentences by template; <kind argument> is a place. Kinds: signal; reference, a number or a signal;
# condition; event, a moment at which something becomes true; level, margin, share, rate and time: numbers.
_FORMS = (
    ("overshoot", rf"the overshoot of <signal signal> {_IS} at most <margin at_most>{_AFTER}"),
    ("overshoot", rf"<signal signal> overshoots <reference reference> by at most <margin at_most>{_AFTER}"),
    (
        "settles",
        rf"<signal signal> settles (?:to|at|near) <reference reference> {_WITHIN} <time time>{_AFTER}",
    ),
    (
        "settles",
        rf"<signal signal> (?:{_IS}|settles) within <margin within> of <reference reference>"
        rf" {_WITHIN} <time time>(?: and stays there for <time stays>)?{_AFTER}",
    ),
    (
        "rise",
        rf"<signal signal> (?:reaches|rises to|gets to) (?:<share reaches> of )?<reference reference>"
        rf" {_WITHIN} <time time>{_AFTER}",
    ),
    (
        "rise",
        rf"<signal signal> (?P<down>falls to|drops to) (?:<share reaches> of )?<reference reference>"
        rf" {_WITHIN} <time time>{_AFTER}",
    ),
    ("response", rf"{_WHENEVER} <condition when>, <condition then> {_WITHIN} <time time>"),
    ("response", rf"<condition then> {_WITHIN} <time time> {_WHENEVER} <condition when>"),
    (
        "never_together",
        r"<condition first> and <condition later> (?:are|must) never (?:be )?(?:\w+ )?"
        r"(?:together|at the same time|both)",
    ),
    ("order", r"<condition later> only (?:after|once) <condition first>"),
    ("order", r"<condition first> before <condition later>"),
    ("dwell", r"<condition condition> for at least <time at_least>(?: (?:and|but) at most <time at_most>)?"),
    ("dwell", r"<condition condition> for at most <time at_most>"),
    ("ramp_limit", r"<signal signal> (?:changes?|moves?) by (?:at most|no more than) <rate limit>"),
    ("stays_within", rf"<signal signal> {_IS} between <level low> and <level high>{_DURING}"),
    ("stays_within", rf"<signal signal> {_IS} within <margin within> of <reference reference>{_DURING}"),
    ("stays_within", rf"<signal signal> {_AT_MOST} <level high>{_DURING}"),
    ("stays_within", rf"<signal signal> {_AT_LEAST} <level low>{_DURING}"),
)
# What a template needs beside what the sentence says; after a condition, this one too.
_NEEDED = {
    "settles": {"within": "MARGIN"},
    "overshoot": {"reference": "REFERENCE"},
    "rise": {"reaches": '"100%"'},
    "ramp_limit": {"over": "SECONDS", "range": "[LOW, HIGH]"},
}
_NEEDED_AFTER = {"settles": "stays", "overshoot": "duration"}

_NUMBER = r"[-+]?(?:\d{1,3}(?:,\d{3})+|\d+)(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])"
_UNIT = r"(?:%|°|(?:°|1/)?[^\W\d_][^\s,]*)(?: cent)?(?: per \w+)?|per \w+"
_QUANTITY = rf"{_NUMBER}(?: ?(?:{_UNIT}))?"
# Words without numbers, and without those that make another requirement of it.
_WORDS = (
    r"(?:(?!(?<![\w.])\d|\b(?:when|whenever|if|while|once|until|unless|before|after|each|every|not|never|only"
    r"|average|mean|rates?|derivative|slope|previous|earlier)\b)[^,])+?"
)
_PLACES = {
    "signal": _WORDS, "condition": _WORDS, "reference": rf"{_QUANTITY}|{_WORDS}", "event": r"[^\d,]+"
}  # fmt: skip
# A signal's name, also with dots.
_NAME = r"[\w.]*\w"
# Words that say nothing of a signal, although its description may contain them.
_EMPTY = frozenset(("and", "are", "for", "from", "has", "off", "per", "than", "that", "the", "this", "with"))
_SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}


def _compiled(form: str) -> re.Pattern[str]:
    named = re.sub(r"<(\w+) (\w+)>", lambda m: f"(?P<{m[1]}_{m[2]}>{_PLACES.get(m[1], _QUANTITY)})", form)
    return re.compile(named, re.IGNORECASE)


# -- reading a sentence --------------------------------------------------------------------------------------


class _UnplacedError(Exception):
    """What stands at a place does not belong there."""


def advised_template(sentence: str, info: ModelInfo, units: Units = MappingProxyType({})) -> Advice | None:
    """Return the template that a sentence in English is; None if it has none of the forms.

    Args:
        sentence: the requirement.
        info: the model's signals.
        units: what the model says of its units.
    """
    text = " ".join(sentence.split()).rstrip(".! ")
    # The unit of "from 5 to 10 s" belongs to both.
    text = re.sub(
        rf"({_NUMBER}) (to|and) ({_NUMBER}) ?(?!in\b|for\b|until\b)({_UNIT})", r"\1 \4 \2 \3 \4", text
    )
    for template, form in _FORMS:
        if (found := _compiled(form).fullmatch(text)) is None:
            continue
        try:
            arguments = _arguments(template, found, info, units)
        except _UnplacedError:
            continue
        lines = [f"{key} = {value}" for key, value in arguments.items()]
        section = "\n".join(["[requirements.NAME]", f'template = "{template}"', *lines])
        return Advice(template, TEMPLATES[template].summary, section)
    return None


def _arguments(template: str, said: re.Match[str], info: ModelInfo, units: Units) -> dict[str, str]:
    """Return the arguments of a template as TOML, for the words at each place."""
    found: dict[str, str] = {}
    unit: str | None = None
    for name, words in said.groupdict().items():
        if words is None:
            continue
        kind, _, key = name.partition("_")
        if kind == "event":
            found[key] = '"CONDITION"'
        elif kind == "condition":
            found[key] = toml_string(f"{_signal(words, info)[0]} > LEVEL")
        elif kind == "down":
            found["direction"] = '"down"'
        elif re.match(_NUMBER, words):
            found[key] = _number(kind, words, unit, units)
        else:
            signal, own = _signal(words, info)
            found[key] = toml_string(signal)
            unit = own if kind == "signal" else unit
    if {"low", "high"} <= found.keys() and float(found["low"]) > float(found["high"]):
        raise _UnplacedError
    if "later" in found:
        found = {"conditions": f"[{found['first']}, {found['later']}]"}
    if "after" in found and template in _NEEDED_AFTER:
        found.setdefault(_NEEDED_AFTER[template], "SECONDS")
    found = _NEEDED.get(template, {}) | found
    during = {"during": f"[{found.get('start', '0')}, {found['end']}]"} if "end" in found else {}
    return {key: found[key] for key in TEMPLATES[template].model_fields if key in found} | during


def _number(kind: str, words: str, own: str | None, units: Units) -> str:
    """Return a number as TOML: times in s, others in the unit of the signal; None: it is not known."""
    digits = re.match(_NUMBER, words)
    assert digits is not None
    value, unit = float(digits[0].replace(",", "")), spelled(words[digits.end() :])
    if kind == "time":
        return f"{tidy(value * _seconds(unit)):.12g}"
    if unit == "%" and (kind == "share" or (kind == "margin" and spelled(own or "") != "%")):
        return f'"{value:g}%"'
    if kind == "rate":
        unit, _, per = re.sub(r"(?:^| )per ", "/", unit).rpartition("/")
        value /= _seconds(spelled(per))
    if unit and not own and not is_known(unit, units):
        raise _UnplacedError  # a word that is no unit, such as "mostly", says something else
    # Of a signal without a unit 5 % may be 5 or 0.05.
    is_plain = not unit or own is None or (not own and unit != "%")
    converted = (1.0, 0.0) if is_plain else factor_and_offset(unit, own or "", units)
    if converted is None or kind == "share":
        raise _UnplacedError
    factor, offset = converted
    return f"{tidy(value * factor + (offset if kind in ('level', 'reference') else 0.0)):.12g}"


def _seconds(unit: str) -> float:
    if unit not in _SECONDS:
        raise _UnplacedError
    return _SECONDS[unit]


def _signal(text: str, info: ModelInfo) -> tuple[str, str | None]:
    """Return the signal, or expression of signals, that a text is about, and its unit.

    That is the signal whose name or description has most words of the text.
    """
    for expression in re.finditer(rf"{_NAME}(?:\s*[-+*/]\s*{_NAME})+", text):
        names = re.findall(_NAME, expression[0])
        if all(name in info for name in names):
            return expression[0], info[names[0]].unit
    words, whole = _parts(text.lower()) - _EMPTY, set(re.findall(_NAME, text))
    named = {
        v.name: (v.name in whole) + 2 * len(words & _parts(v.name)) + len(words & _parts(v.description))
        for v in (*info.outputs, *info.inputs)
        if v.kind != "string"
    }
    best = max(named, key=named.__getitem__, default="")
    return (name_text(best), info[best].unit) if named.get(best) else ("SIGNAL", None)


def _parts(name: str) -> set[str]:
    split = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return set(re.findall(r"[a-z]{3,}", split.lower()))
