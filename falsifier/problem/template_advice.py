"""Which template fits a requirement in words, by its words alone; for those without a language model.

Only English is understood. Nothing is guessed: the template and the signal are proposed, and all else is left
in capital letters.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from falsifier.core.model import ModelInfo
from falsifier.problem.templates import TEMPLATES
from falsifier.stl.names import name_text

# Words that speak for a template, as regular expressions; those of more weight come first. In the text, @
# stands for a time, # for any other number.
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
    "ramp_limit": (r"per (second|minute)|/s\b", r"\brate\b", r"\bramp", r"\bchang\w+ by"),
    "order": (r"\bbefore\b", r"\bonly (once|after)", r"\bfirst\b.*\bthen\b", r"order"),
    "stays_within": (
        r"between", r"\b(below|under|above|over)\b", r"at (most|least)", r"exceed",
        r"(never|no|not) (more|less|higher|lower|greater|smaller)",
        r"within", r"\bmaxim", r"\bminim",
    ),
}  # fmt: skip
# The arguments of each template, with capital letters for what is to be filled in.
_LINES: Mapping[str, Mapping[str, str]] = {
    "settles": {"signal": "SIGNAL", "reference": "REFERENCE", "within": "MARGIN", "time": "SECONDS"},
    "overshoot": {"signal": "SIGNAL", "reference": "REFERENCE", "at_most": "MARGIN"},
    "rise": {"signal": "SIGNAL", "reference": "REFERENCE", "reaches": '"100%"', "time": "SECONDS"},
    "response": {"when": '"CONDITION"', "then": '"CONDITION"', "time": "SECONDS"},
    "stays_within": {"signal": "SIGNAL", "low": "LOW", "high": "HIGH"},
    "never_together": {"conditions": '["CONDITION", "CONDITION"]'},
    "dwell": {"condition": '"CONDITION"', "at_least": "SECONDS"},
    "ramp_limit": {"signal": "SIGNAL", "limit": "PER_SECOND", "over": "SECONDS", "range": "[LOW, HIGH]"},
    "order": {"conditions": '["CONDITION", "CONDITION"]'},
}
# What else those need that may apply each time when a condition becomes true.
_AFTER: Mapping[str, Mapping[str, str]] = {
    "settles": {"after": '"CONDITION"', "stays": "SECONDS"},
    "overshoot": {"after": '"CONDITION"', "duration": "SECONDS"},
    "rise": {"after": '"CONDITION"'},
}

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
_TIME = re.compile(r"\b\d[\d.,]*\s*(?:m?s|min|h|(?:milli)?sec(?:ond)?s?|minutes?|hours?)\b")
_NUMBER = re.compile(r"\b\d[\d.,]*")
_CONDITIONAL = re.compile(
    r"\b(?:when(?:ever)?|if|while|once|until|unless|as long as|(?:each|every) time|before|after(?! *[#@]))\b"
)
# Words that say nothing of a signal, although its description may contain them.
_EMPTY = frozenset(
    ("and", "are", "for", "from", "has", "not", "off", "per", "than", "that", "the", "this", "with")
)


@dataclass(frozen=True, slots=True)
class Advice:
    """A template that may fit.

    Attributes:
        template: its name.
        summary: what it requires.
        section: a section of a spec; what is in capital letters has to be filled in.
    """

    template: str
    summary: str
    section: str


def hint(sentence: str) -> str:
    """Return what formulas cannot say, if a sentence may need that; else an empty text."""
    return WHAT_CANNOT_BE_SAID if _BEYOND.search(sentence.lower()) else ""


def advised_templates(sentence: str, info: ModelInfo, *, most: int = 2) -> list[Advice]:
    """Return the templates that fit a sentence, the best first; empty if there are none.

    Args:
        sentence: the requirement, in English.
        info: the model's signals.
        most: maximum number of templates.
    """
    marked = _NUMBER.sub("#", _TIME.sub("@", sentence.lower()))
    scores = {name: _score(marked, words) for name, words in _WORDS.items()}
    is_conditional = bool(_CONDITIONAL.search(marked))
    if is_conditional:  # these have no place for a condition
        scores |= {"stays_within": 0, "ramp_limit": 0}
    fitting = sorted((name for name in scores if scores[name]), key=lambda name: -scores[name])
    signal = next(iter(mentioned_signals(sentence, info)), "")
    return [
        Advice(name, TEMPLATES[name].summary, _section(name, signal, is_conditional=is_conditional))
        for name in fitting[:most]
    ]


def mentioned_signals(sentence: str, info: ModelInfo) -> list[str]:
    """Return the signals whose names, or words of whose descriptions, occur in a sentence; best first."""
    words = set(re.findall(r"[a-z]{3,}", sentence.lower())) - _EMPTY
    whole = set(re.findall(r"[\w.]*\w", sentence))
    variables = [v for v in (*info.outputs, *info.inputs) if v.kind != "string"]
    named = {
        v.name: (v.name in whole) + 2 * len(words & _parts(v.name)) + len(words & _parts(v.description))
        for v in variables
    }
    return sorted((name for name in named if named[name]), key=lambda name: -named[name])


def _parts(name: str) -> set[str]:
    split = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return set(re.findall(r"[a-z]{3,}", split.lower()))


def _score(text: str, words: Iterable[str]) -> int:
    """Return how strongly words speak for a template: the first of its words counts most."""
    return max((10 - rank for rank, word in enumerate(words) if re.search(word, text)), default=0)


def _section(template: str, signal: str, *, is_conditional: bool) -> str:
    """Return the section of a spec for a template."""
    lines = {**_LINES[template], **(_AFTER.get(template, {}) if is_conditional else {})}
    if signal and "signal" in lines:
        quoted = name_text(signal).replace("\\", "\\\\").replace('"', '\\"')
        lines["signal"] = f'"{quoted}"'
    written = (f"{key} = {value}" for key, value in lines.items())
    return "\n".join(["[requirements.NAME]", f'template = "{template}"', *written])
