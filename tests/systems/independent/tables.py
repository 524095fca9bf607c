"""Reads tables and weights out of the Modelica sources: numbers are written once, equations twice."""

import json
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_SOURCES = Path(__file__).parents[3] / "modelica" / "ArchComp"
_CONSTANT = re.compile(r"constant Real (\w+)\[[^\]]*\](?:\([^)]*\))?\s*=\s*(\{[^;\"]*\})")


def tables(source: str) -> dict[str, NDArray[np.float64]]:
    """Array constants of one Modelica file, by name."""
    text = (_SOURCES / f"{source}.mo").read_text()
    return {
        name: np.array(json.loads(literal.replace("{", "[").replace("}", "]")), dtype=np.float64)
        for name, literal in _CONSTANT.findall(text)
    }
