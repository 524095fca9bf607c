"""Reading and writing many variables of an FMU at once, whatever their types.

An FMU transfers values by type: one call for all Reals, one for all Booleans. A :class:`Ports` value contains
integer tables, suitable for compiled code, of the calls to make and of each variable's location in the
buffers of these calls.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.errors import ModelError
from falsifier.fmu.description import Description, Slot
from falsifier.fmu.process.encoding import STORAGE, STORED

Table = NDArray[np.int64]
# What the compiled loops receive of Ports: integers, because compiled code counts references to arrays.
Addresses = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Ports:
    """FMI calls and memory locations for some variables.

    Attributes:
        calls: one row per FMI call: address of the function, address and number of the value references,
            address and number of the values.
        places: one row per variable: storage code, address of the value, sign (-1 for a negated alias), and
            1 for a Boolean.
        fixed: the same for elements that are fixed; see ``make_ports``.
        limits: smallest and largest number of each variable's type, shape (n, 2); infinite for reals.
        memory: the arrays to which the addresses point; a reference keeps them alive.
        table: argument of the compiled loops: address and number of calls, address and number of places.
        is_limited: whether any of the variables has limits.
    """

    calls: Table
    places: Table
    fixed: Table
    limits: NDArray[np.float64]
    memory: tuple[NDArray[np.generic], ...]
    table: Addresses
    is_limited: bool


def make_ports(
    description: Description, names: Sequence[str], addresses: Mapping[str, int], fixed: Sequence[str] = ()
) -> Ports:
    """Return the calls and memory locations for the named variables.

    Args:
        description: description of the FMU.
        names: names of the variables, in the order of the rows of ``places``.
        addresses: addresses of either the get or the set functions, by type code.
        fixed: other elements of the same arrays, which keep the value that is written to them once.

    Raises:
        ModelError: if the library does not export the function for a type.
    """
    slots = [description.slot(name) for name in (*names, *fixed)]
    places = np.zeros((len(slots), 4), dtype=np.int64)
    limits = np.tile(np.array([-np.inf, np.inf]), (len(slots), 1))
    calls, memory = [], []
    for code in dict.fromkeys(slot.type for slot in slots):
        members = [slot for slot in slots if slot.type == code]
        starts = _starts(members)
        stored = STORED[description.major][code]
        references = np.array(list(starts), dtype=np.uint32)
        values = np.zeros(sum(_sizes(members).values()), dtype=stored)
        # A set call transfers whole arrays: elements that are not searched keep their start values.
        for reference, start in starts.items():
            if reference in description.arrays:
                numbers = description.arrays[reference]
                values[start : start + len(numbers)] = numbers
        address = addresses.get(code, 0)
        if not address:
            raise ModelError(
                f"{description.info.name}: the library does not export the function for values of type {code}"
            )
        calls.append((address, references.ctypes.data, references.size, values.ctypes.data, values.size))
        memory += [references, values]
        for row, slot in enumerate(slots):
            if slot.type == code:
                at = values.ctypes.data + values.itemsize * (starts[slot.reference] + slot.offset)
                places[row] = STORAGE.index(stored), at, -1 if slot.negated else 1, code == "Boolean"
                if not stored.startswith("f"):
                    kind = np.iinfo(stored)
                    limits[row] = (0, 1) if code == "Boolean" else (kind.min, kind.max)
    rows = np.array(calls, dtype=np.int64).reshape(-1, 5)
    return Ports(
        calls=rows,
        places=places[: len(names)],
        fixed=places[len(names) :],
        limits=limits[: len(names)],
        memory=tuple(memory),
        table=(rows.ctypes.data, len(rows), places.ctypes.data, len(names)),
        is_limited=bool(np.isfinite(limits[: len(names)]).any()),
    )


def bytes_per_value(major: int, code: str) -> int:
    """Return the size of a value of a type in calls of this FMI version."""
    return np.dtype(STORED[major][code]).itemsize


def _sizes(slots: Sequence[Slot]) -> dict[int, int]:
    return {slot.reference: slot.size for slot in slots}


def _starts(slots: Sequence[Slot]) -> dict[int, int]:
    """Return the position of each value reference's first value in the buffer of its call."""
    starts, position = {}, 0
    for reference, size in _sizes(slots).items():
        starts[reference] = position
        position += size
    return starts
