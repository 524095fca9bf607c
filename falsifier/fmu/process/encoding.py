"""What the worker is told, in bytes: numbers of 8 bytes, and blocks of bytes after their number.

``falsifier/fmu/worker/request.c`` is the other side.
"""

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np

from falsifier.errors import ModelError
from falsifier.fmu.description.libraries import HOW_TO_INSTALL, find_wine, windows_path
from falsifier.fmu.description.model_description import Description
from falsifier.fmu.process.network import Member

# Storage types of values; their position is the number that request.c reads.
STORAGE: tuple[str, ...] = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")
STORED: Mapping[int, Mapping[str, str]] = {
    1: {"Real": "f8", "Integer": "i4", "Boolean": "u1"},
    2: {"Real": "f8", "Integer": "i4", "Boolean": "i4"},
    3: {
        "Float64": "f8",
        "Float32": "f4",
        "Boolean": "u1",
        **{f"Int{b}": f"i{b // 8}" for b in (8, 16, 32, 64)},
        **{f"UInt{b}": f"u{b // 8}" for b in (8, 16, 32, 64)},
    },
}

# The largest integer of a request.
_MOST = (1 << 63) - 1


def integers(*numbers: int) -> bytes:
    """Return integers as they are in requests."""
    return struct.pack(f"<{len(numbers)}q", *numbers)


def reals(*numbers: float) -> bytes:
    """Return real numbers as they are in requests."""
    return struct.pack(f"<{len(numbers)}d", *numbers)


def text(words: str) -> bytes:
    """Return a text as it is in requests."""
    return block(words.encode("utf-8", "surrogateescape") + b"\0")  # paths may be any bytes


def block(data: bytes) -> bytes:
    """Return bytes as they are in requests: after their number, padded to a multiple of 8."""
    return struct.pack("<Q", len(data)) + data + bytes(-len(data) % 8)


def ports(description: Description, names: Sequence[str]) -> bytes:
    """Return the calls that get or set these variables, and where each value is in their buffers."""
    calls, places = _table(description, names)
    return calls + integers(len(names)) + b"".join(places)


def inputs(description: Description, names: Sequence[str], parameters: Sequence[str]) -> bytes:
    """Return the same for inputs, and which parameters are other elements of their arrays (FMI 3).

    Setting an input sets its whole array, and must not put the other elements back to their start values.
    """
    slots = [description.slot(name) for name in names]
    arrays = {slot.reference for slot in slots if slot.size > 1}
    driven = {(slot.reference, slot.offset) for slot in slots}
    found = [(k, description.slot(name)) for k, name in enumerate(parameters)]
    fixed = [k for k, s in found if s.reference in arrays and (s.reference, s.offset) not in driven]
    calls, places = _table(description, [*names, *(parameters[k] for k in fixed)])
    own, others = places[: len(names)], places[len(names) :]
    numbered = [place + integers(k) for place, k in zip(others, fixed, strict=True)]
    return calls + integers(len(own)) + b"".join(own) + integers(len(numbered)) + b"".join(numbered)


def _table(description: Description, names: Sequence[str]) -> tuple[bytes, list[bytes]]:
    """Return the calls that transfer some variables, one per type, and the place of each variable in them."""
    slots = [description.slot(name) for name in names]
    codes = list(dict.fromkeys(slot.type for slot in slots))
    stored = STORED[description.major]
    calls, starts = [integers(len(codes))], []
    for code in codes:
        sizes = {slot.reference: slot.size for slot in slots if slot.type == code}
        begins = dict(zip(sizes, np.cumsum([0, *sizes.values()]).tolist(), strict=False))
        values = np.zeros(sum(sizes.values()), dtype=stored[code])
        # A set call transfers whole arrays: elements that are not searched keep their start values.
        for reference, start in begins.items():
            numbers = description.arrays.get(reference, ())
            values[start : start + len(numbers)] = numbers
        references = np.array(list(sizes), dtype=np.uint32)
        calls += [text(code), block(references.tobytes()), integers(values.size), block(values.tobytes())]
        starts.append(begins)
    places = []
    for slot in slots:
        call, kind = codes.index(slot.type), stored[slot.type]
        offset = np.dtype(kind).itemsize * (starts[call][slot.reference] + slot.offset)
        head = integers(STORAGE.index(kind), call, offset)
        places.append(head + reals(-1.0 if slot.negated else 1.0) + integers(slot.type == "Boolean"))
    return b"".join(calls), places


def fmu(member: Member, folder: Path, *, logging: bool, through_wine: bool) -> bytes:
    """Return what the worker needs to load an unpacked FMU; ModelError if it has no library for it."""
    description, interface = member.description, member.interface
    libraries = description.libraries
    found = libraries.windows if through_wine else libraries.here
    if interface not in found:
        raise ModelError(f"{member.path}: {libraries.lacking[interface]}")
    if through_wine and find_wine() is None:
        raise ModelError(f"{member.path}: its library runs through Wine, which is missing: {HOW_TO_INSTALL}")
    library = folder / found[interface]
    resources = folder / "resources"
    if through_wine:
        names = [windows_path(library), windows_path(resources) + "\\"]
        addresses = ["file:///Z:" + quote(str(path)) for path in (folder, resources)]
    else:
        names, addresses = [str(library), f"{resources}/"], [folder.as_uri(), resources.as_uri()]
    events = description.major == 3 and interface == "co-simulation" and description.event_mode
    numbers = integers(
        description.major,
        interface == "model-exchange",
        logging,
        events,
        interface in description.saves_state,
        # A description may say anything; the worker refuses what is too many.
        min(description.states, _MOST),
        min(description.indicators, _MOST),
    )
    words = (
        names[0],
        description.identifiers[interface],
        description.info.name,
        description.token,
        (*addresses, names[1])[description.major - 1],
    )
    return numbers + b"".join(map(text, words))
