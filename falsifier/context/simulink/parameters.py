"""Which parameters of a block carry meaning; the others say how it is drawn or generated."""

import tomllib
from collections.abc import Mapping
from importlib.resources import files

from falsifier.core.words import shortened

_SATURATION = ("LimitOutput", "UpperSaturationLimit", "LowerSaturationLimit")
_NAMES = tomllib.loads(files(__package__).joinpath("names.toml").read_text(encoding="utf-8"))
_LISTED, _MEANINGFUL, _DRAWN = (frozenset(_NAMES[key].split()) for key in ("blocks", "meaningful", "drawn"))
_TYPES = ("DataTypeStr", "DataType", "DataTypeName", "ParamMin", "ParamMax")
# Values that say nothing: inherited sample times, no limits, off.
_EMPTY = frozenset(("", "[]", "-1", "off", "none"))
_KEPT_EVEN_IF_EMPTY = frozenset(
    ("Value", "Gain", "Threshold", "UpperLimit", "LowerLimit", "gainval", "Operator")
)
_LONGEST_VALUE = 2000


def meaningful(
    kind: str, stated: Mapping[str, str], defaults: Mapping[str, str]
) -> tuple[tuple[str, str], ...]:
    """Return the parameters of a block that carry meaning, as pairs of name and value.

    The ``defaults`` are what the file states of all blocks of this type.
    """
    if kind in _LISTED:
        everything = {**stated, **defaults, **stated}  # what is stated comes first, and counts
        found = {name: value for name, value in everything.items() if name in _MEANINGFUL}
    else:
        found = {name: value for name, value in stated.items() if not _is_drawn(name, value)}
    if (found.get("LimitOutput") or "off") == "off":
        found = {name: value for name, value in found.items() if name not in _SATURATION}
    sample = stated.get("SampleTime", "")
    if kind not in ("Constant", "SubSystem") or sample not in ("inf", "-1"):
        found["SampleTime"] = sample
    return tuple(
        (name, shortened(" ".join(value.split()), _LONGEST_VALUE))
        for name, value in found.items()
        if value.strip() not in _EMPTY or (name in _KEPT_EVEN_IF_EMPTY and value.strip())
    )


def _is_drawn(name: str, value: str) -> bool:
    """Whether a parameter says how a block is drawn or which types it has; library blocks state dozens."""
    return name in _DRAWN or name.startswith("Mask") or name.endswith(_TYPES) or value.startswith("Inherit")
