"""Prompt variants: which parts a prompt contains. Nothing else differs between variants."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from falsifier.errors import SpecError, did_you_mean
from falsifier.llm import CONTEXT_VARIANT, DEFAULT_VARIANT

Part = Literal[
    "names",  # inputs and parameters by name and meaning; otherwise numbered dimensions
    "requirement",  # the formula
    "outputs",  # the signals of the formula
    "values",  # per sample: what the formula compares, at the control-point times
    "critical",  # per sample: critical time and signal values at that time
    "guidance",  # what to consider, as the published prompts say
    "advice",  # advice that fits the problem
    "system",  # the model's description, all recorded signals with units and descriptions
    "reading",  # the formula in plain words, its terms as derived signals
    "freedom",  # control points and interpolation may be chosen if the problem allows it
    "observations",  # per sample: all signals over time, what decided, robustness of the parts
    "history",  # all samples: what each was the first to reach, its rationale; those before it stay as told
    "lessons",  # what the language model wrote down for itself
    "circumstances",  # the budget and what is left of it, the outputs at time 0
    "failures",  # samples that could not be simulated, with the reason
    "context",  # what named files say: thresholds beside the signals, excerpts
]


@dataclass(frozen=True, slots=True)
class Variant:
    """A named set of parts.

    Attributes:
        name: name on the command line and in spec files.
        parts: what the prompt contains.
    """

    name: str
    parts: frozenset[Part]

    def has(self, part: Part) -> bool:
        """Whether the prompt contains this part."""
        return part in self.parts

    @property
    def is_published(self) -> bool:
        """Whether the variant follows a published prompt and tells nothing more."""
        return self.has("guidance")


def _variants() -> Mapping[str, Variant]:
    # MP1 to MP4 follow the published prompts, each adding to the one before; MP5 and MP6 are our own.
    # What is told at which place is compared line by line in design/published-prompts.md.
    mp1: frozenset[Part] = frozenset({"guidance"})
    mp2: frozenset[Part] = mp1 | {"names", "requirement", "outputs"}
    mp3: frozenset[Part] = mp2 | {"values"}
    mp4: frozenset[Part] = mp3 | {"critical"}
    more: frozenset[Part] = frozenset(
        (
            "advice",
            "system",
            "reading",
            "freedom",
            "observations",
            "history",
            "lessons",
            "circumstances",
            "failures",
        )
    )
    mp5 = (mp4 - {"values", "guidance"}) | more
    context: frozenset[Part] = frozenset({"context"})
    parts = {"MP1": mp1, "MP2": mp2, "MP3": mp3, "MP4": mp4, "MP5": mp5, "MP6": mp5 | context}
    return MappingProxyType({name: Variant(name, found) for name, found in parts.items()})


VARIANTS = _variants()


def variant_named(name: str | None, *, has_context: bool = False) -> Variant:
    """Variant of this name, in any case; None: the default one.

    Args:
        name: the name.
        has_context: whether files are named, which makes the default the variant that tells them.

    Raises:
        SpecError: for an unknown name.
    """
    default = CONTEXT_VARIANT if has_context else DEFAULT_VARIANT
    name = default if name is None else name.upper()
    if name not in VARIANTS:
        raise SpecError(f"unknown prompt variant {name!r}; {did_you_mean(name, VARIANTS)}")
    return VARIANTS[name]
