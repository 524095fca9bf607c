"""SI base units of the units in the models, which tools need to convert values."""

from __future__ import annotations

from math import pi

_FOOT = 0.3048


_POUND_FORCE = 4.4482216152605


_MINUTE = 60.0


_UNITS: dict[str, dict[str, float]] = {
    "1": {},
    "%": {"factor": 0.01},
    "s": {"s": 1},
    "ms": {"s": 1, "factor": 1e-3},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "ft": {"m": 1, "factor": _FOOT},
    "ft/s": {"m": 1, "s": -1, "factor": _FOOT},
    "mph": {"m": 1, "s": -1, "factor": 0.44704},
    "rev/min": {"rad": 1, "s": -1, "factor": 2 * pi / _MINUTE},
    "rev/min/s": {"rad": 1, "s": -2, "factor": 2 * pi / _MINUTE},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "deg": {"rad": 1, "factor": pi / 180},
    "deg/s": {"rad": 1, "s": -1, "factor": pi / 180},
    "ft.lbf": {"kg": 1, "m": 2, "s": -2, "factor": _FOOT * _POUND_FORCE},
    "lbf": {"kg": 1, "m": 1, "s": -2, "factor": _POUND_FORCE},
    "g": {"kg": 1, "factor": 1e-3},
    "g/s": {"kg": 1, "s": -1, "factor": 1e-3},
    "kg": {"kg": 1},
    "kg/s": {"kg": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "kPa": {"kg": 1, "m": -1, "s": -2, "factor": 1e3},
    "bar": {"kg": 1, "m": -1, "s": -2, "factor": 1e5},
    "degC": {"K": 1, "offset": 273.15},
    "K": {"K": 1},
    "W": {"kg": 1, "m": 2, "s": -3},
    "kW": {"kg": 1, "m": 2, "s": -3, "factor": 1e3},
    "A": {"A": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "1/min": {"s": -1, "factor": 1 / _MINUTE},
}


def display_unit(name: str, unit: str | None) -> dict[str, str] | None:
    """Return the attributes of the DisplayUnit element; None if the units are not known as alike."""
    shown, stored = _UNITS.get(name), _UNITS.get(unit or "")
    if shown is None or stored is None:
        return None
    scale = ("factor", "offset")
    if {k: v for k, v in shown.items() if k not in scale} != {
        k: v for k, v in stored.items() if k not in scale
    }:
        return None
    factor = shown.get("factor", 1.0)
    offset = (stored.get("offset", 0.0) - shown.get("offset", 0.0)) / factor
    return {"factor": repr(stored.get("factor", 1.0) / factor), "offset": repr(offset)}


def base_unit(name: str) -> dict[str, str] | None:
    """Return the attributes of the BaseUnit element; None for an unknown unit."""
    found = _UNITS.get(name)
    if found is None:
        return None
    return {key: repr(float(v)) if key in ("factor", "offset") else str(int(v)) for key, v in found.items()}
