"""Which template fits a requirement in words, by its words alone; for those without a language model."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from falsifier.core.model import ModelInfo
from falsifier.problem.templates import TEMPLATES
from falsifier.stl.names import name_text

# Words that speak for a template, as regular expressions; those of more weight come first.
_WORDS = {
    "settles": (r"settl", r"converg", r"within \S+ ?%? of", r"steady"),
    "overshoot": (r"overshoot", r"exceeds? .*by (more than|at most)", r"undershoot"),
    "rise": (r"\brise", r"\breach", r"\bget up to"),
    "response": (r"when(ever)?\b.*\b(within|after)", r"\bif\b.*\bwithin", r"follow", r"respon", r"react"),
    "never_together": (
        r"never .*(together|both|same time|simultan)", r"not .*(both|at the same time)", r"exclusive",
    ),
    "dwell": (
        r"(stays?|remains?|holds?|lasts?|on|off|active) .*for at (least|most)", r"\bdwell", r"minimum time",
    ),
    "ramp_limit": (r"per (second|minute)", r"\brate\b", r"\bramp", r"/s\b", r"change.* by more than .* in"),
    "order": (r"\bbefore\b", r"\bonly (once|after)", r"\bfirst\b.*\bthen\b", r"order"),
    "stays_within": (
        r"between", r"\b(below|under|above|over)\b", r"at (most|least)", r"exceed",
        r"never (more|less|higher|lower)",
        r"within", r"\bmax", r"\bmin",
    ),
}  # fmt: skip
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?")
_EXAMPLES = {
    "settles": ('signal = "{s0}"', "reference = REFERENCE", 'within = "2%"', "time = SECONDS"),
    "overshoot": ('signal = "{s0}"', "reference = REFERENCE", 'at_most = "10%"'),
    "rise": ('signal = "{s0}"', "reference = REFERENCE", "time = SECONDS"),
    "response": ('when = "{s0} > LEVEL"', 'then = "{s1} > LEVEL"', "time = SECONDS"),
    "stays_within": ('signal = "{s0}"', "low = LOW", "high = HIGH"),
    "never_together": ('conditions = ["{s0} > LEVEL", "{s1} > LEVEL"]',),
    "dwell": ('condition = "{s0} > LEVEL"', "at_least = SECONDS"),
    "ramp_limit": ('signal = "{s0}"', "limit = PER_SECOND", "over = SECONDS", "range = [LOW, HIGH]"),
    "order": ('conditions = ["{s0} > LEVEL", "{s1} > LEVEL"]',),
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


def hint(sentence: str) -> str:
    """Return what formulas cannot say, if a sentence may need that; else an empty text."""
    return WHAT_CANNOT_BE_SAID if _BEYOND.search(sentence.lower()) else ""


@dataclass(frozen=True, slots=True)
class Advice:
    """A template that may fit.

    Attributes:
        template: its name.
        summary: what it requires.
        section: a section of a spec; what is in capital letters has to be filled in.
        numbers: numbers of the sentence, which belong there.
    """

    template: str
    summary: str
    section: str
    numbers: tuple[str, ...]


def advised_templates(sentence: str, info: ModelInfo, *, most: int = 2) -> list[Advice]:
    """Return the templates whose words occur in a sentence, the best first; empty if there are none."""
    text = sentence.lower()
    scores = {name: _score(text, words) for name, words in _WORDS.items()}
    best = sorted((name for name in scores if scores[name]), key=lambda name: -scores[name])[:most]
    signals = mentioned_signals(sentence, info)
    numbers = tuple(_NUMBER.findall(sentence))
    return [Advice(name, TEMPLATES[name].summary, _section(name, signals), numbers) for name in best]


def mentioned_signals(sentence: str, info: ModelInfo) -> list[str]:
    """Return the signals whose names, or words of whose descriptions, occur in a sentence; best first."""
    words, whole = set(re.findall(r"[a-z]{3,}", sentence.lower())), set(re.findall(r"[\w.]*\w", sentence))
    variables = [v for v in (*info.outputs, *info.inputs) if v.kind != "string"]
    named = {
        v.name: (v.name in whole) + 2 * len(words & _parts(v.name)) + len(words & _parts(v.description))
        for v in variables
    }
    return sorted((name for name in named if named[name]), key=lambda name: -named[name])


def _score(text: str, words: Iterable[str]) -> int:
    """Return how strongly words speak for a template: the first of its words counts most."""
    return max((10 - rank for rank, word in enumerate(words) if re.search(word, text)), default=0)


def _parts(name: str) -> set[str]:
    split = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return set(re.findall(r"[a-z]{3,}", split.lower()))


def _section(template: str, signals: list[str]) -> str:
    known = [name_text(name).replace('"', '\\"') for name in signals]
    s0, s1 = [*known, "SIGNAL", "OTHER_SIGNAL"][:2] if len(known) != 1 else (known[0], "OTHER_SIGNAL")
    lines = (line.format(s0=s0, s1=s1) for line in _EXAMPLES[template])
    return "\n".join(["[requirements.NAME]", f'template = "{template}"', *lines])
