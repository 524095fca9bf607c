"""Scalars by the names that the FMU declares: other tools know arrays and no aliases (FMI 3)."""

from collections.abc import Callable, Mapping
from typing import TypeVar

from falsifier.core.model import Model
from falsifier.fmu import FmuModel

T = TypeVar("T")


def by_declaration(model: Model, scalars: Mapping[str, T], other: Callable[[str], T]) -> dict[str, list[T]]:
    """Return the values of all elements of each declared variable of which a scalar is given.

    Args:
        model: the model; without an FMU, every scalar is declared as it is.
        scalars: values by name.
        other: returns the value of an element that is not given, by its name.
    """
    if not isinstance(model, FmuModel):
        return {name: [value] for name, value in scalars.items()}
    found: dict[str, list[T]] = {}
    for name in scalars:
        declared, _ = model.place(name)
        if declared not in found:
            elements = model.elements(declared)
            found[declared] = [scalars[e] if e in scalars else other(e) for e in elements]
    return found


def start_of(model: Model, name: str) -> float:
    """Return the model's own start value; 0 if it states none."""
    start = model.info[name].start
    return float(start) if isinstance(start, int | float) else 0.0
