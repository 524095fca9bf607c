"""Reading and writing many variables of an FMU at once, whatever their types.

An FMU hands out values type by type: one call for all Reals, one for all Booleans. A :class:`Ports` value
holds, as plain integer tables that compiled code can walk, which calls to make and where each variable lies
in the buffers that the calls fill.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.errors import ModelError
from falsifier.fmu.description import Description, Slot

Table = NDArray[np.int64]
# What the loops get of Ports: integers, because compiled code counts references to every array it touches.
Addresses = tuple[int, int, int, int]

# How a value lies in memory: the position is the code that the compiled loops switch on.
STORAGE: tuple[str, ...] = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")

_STORED_3: Mapping[str, str] = {
    "Float64": "f8",
    "Float32": "f4",
    "Boolean": "u1",
    **{f"Int{b}": f"i{b // 8}" for b in (8, 16, 32, 64)},
    **{f"UInt{b}": f"u{b // 8}" for b in (8, 16, 32, 64)},
}
_STORED: Mapping[int, Mapping[str, str]] = {
    1: {"Real": "f8", "Integer": "i4", "Boolean": "u1"},
    2: {"Real": "f8", "Integer": "i4", "Boolean": "i4"},
    3: _STORED_3,
}


@dataclass(frozen=True, slots=True, eq=False)
class Ports:
    """Calls and places for some variables.

    Attributes:
        calls: one row per FMI call: address of the function, of the value references, number of these,
            address of the values, number of these.
        places: one row per variable: storage code, address of the value, sign (-1 for a negated alias), and
            1 for a Boolean.
        limits: smallest and largest number that fits, shape (n, 2); infinite for floating point.
        memory: the arrays that the addresses point into.
        table: what the loops get: address and number of the calls, address and number of the places.
        is_limited: whether any of the variables has limits.
    """

    calls: Table
    places: Table
    limits: NDArray[np.float64]
    memory: tuple[NDArray[np.generic], ...]
    table: Addresses
    is_limited: bool


def make_ports(description: Description, names: Sequence[str], addresses: Mapping[str, int]) -> Ports:
    """Calls and places for the named variables.

    Args:
        description: of the FMU.
        names: variables, which become the rows of ``places`` in this order.
        addresses: of the get or of the set functions, by type code.

    Raises:
        ModelError: when the library has no function for a type.
    """
    slots = [description.slot(name) for name in names]
    places = np.zeros((len(names), 4), dtype=np.int64)
    limits = np.tile(np.array([-np.inf, np.inf]), (len(names), 1))
    calls, memory = [], []
    for code in dict.fromkeys(slot.type for slot in slots):
        members = [slot for slot in slots if slot.type == code]
        starts = _starts(members)
        stored = _STORED[description.major][code]
        references = np.array(list(starts), dtype=np.uint32)
        values = np.zeros(sum(_sizes(members).values()), dtype=stored)
        for reference, start in starts.items():
            if reference in description.arrays:
                numbers = description.arrays[reference]
                values[start : start + len(numbers)] = numbers
        address = addresses.get(code, 0)
        if not address:
            raise ModelError(
                f"{description.info.name}: the library has no function for values of type {code}"
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
        places=places,
        limits=limits,
        memory=tuple(memory),
        table=(rows.ctypes.data, len(rows), places.ctypes.data, len(places)),
        is_limited=bool(np.isfinite(limits).any()),
    )


def _sizes(slots: Sequence[Slot]) -> dict[int, int]:
    return {slot.reference: slot.size for slot in slots}


def _starts(slots: Sequence[Slot]) -> dict[int, int]:
    """Position of each value reference's first value in the buffer of its call."""
    starts, position = {}, 0
    for reference, size in _sizes(slots).items():
        starts[reference] = position
        position += size
    return starts
