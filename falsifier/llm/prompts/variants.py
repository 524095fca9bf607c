"""Prompt variants: which parts of what is known a prompt tells. Nothing else differs between them."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from falsifier.errors import SpecError, did_you_mean

Part = Literal[
    "names",  # inputs and parameters by name and meaning; else numbered dimensions
    "requirement",  # the formula
    "outputs",  # the signals of the formula
    "values",  # of each sample: outputs at the control-point times
    "critical",  # of each sample: critical time and signal values there
    "advice",  # how to use all this
    "system",  # the model's description, all recorded signals with units and descriptions
    "reading",  # the formula in plain words, its terms as signals of their own
    "freedom",  # control points and interpolation may be chosen where the problem allows it
    "observations",  # of each sample: course of all signals, what decided, robustness of the parts
    "selection",  # best and most different samples beside the most recent ones
    "failures",  # samples that could not be simulated, with the reason
]


@dataclass(frozen=True, slots=True)
class Variant:
    """A named set of parts.

    Attributes:
        name: as the user names it.
        parts: what the prompt tells.
    """

    name: str
    parts: frozenset[Part]

    def has(self, part: Part) -> bool:
        """Whether the prompt tells this part."""
        return part in self.parts


def _variants() -> Mapping[str, Variant]:
    mp1: frozenset[Part] = frozenset()
    mp2: frozenset[Part] = mp1 | {"names", "requirement", "outputs"}
    mp3: frozenset[Part] = mp2 | {"values", "advice"}
    mp4: frozenset[Part] = mp3 | {"critical"}
    more: frozenset[Part] = frozenset(
        ("system", "reading", "freedom", "observations", "selection", "failures")
    )
    mp5 = (mp4 - {"values"}) | more
    parts = {"MP1": mp1, "MP2": mp2, "MP3": mp3, "MP4": mp4, "MP5": mp5}
    return MappingProxyType({name: Variant(name, found) for name, found in parts.items()})


VARIANTS = _variants()
DEFAULT_VARIANT = "MP5"


def variant_named(name: str | None) -> Variant:
    """Variant of this name; None: the default one.

    Raises:
        SpecError: for an unknown name.
    """
    name = DEFAULT_VARIANT if name is None else name.upper()
    if name not in VARIANTS:
        raise SpecError(f"unknown prompt variant {name!r}; {did_you_mean(name, VARIANTS)}")
    return VARIANTS[name]
