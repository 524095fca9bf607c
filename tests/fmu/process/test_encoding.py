"""Bytes as the worker reads them; simulations through Wine show that it understands them."""

import struct

from falsifier.core.model import ModelInfo
from falsifier.fmu.description import Description, Slot, read_description
from falsifier.fmu.process import encoding
from tests.fmu.fixtures import path


def test_texts_are_padded() -> None:
    assert encoding.text("ä") == struct.pack("<Q", 3) + "ä\0".encode() + bytes(5)
    assert encoding.block(bytes(8)) == struct.pack("<Q", 8) + bytes(8)


def test_fixed_elements_follow_the_places_of_their_array() -> None:
    """u has four elements; one is driven, and another is set as a parameter."""
    description = read_description(path("Arrays_3"))
    names = [name for name, slot in description.slots.items() if slot.size > 1]
    first, second = [
        n for n in names if description.slot(n).reference == description.slot(names[0]).reference
    ][:2]
    alone, beside = (encoding.inputs(description, [first], p) for p in ((), (second, first)))
    place = alone[-6 * 8 : -8]
    assert alone[-8:] == encoding.integers(0) and beside.startswith(alone[:-8])
    storage, call, offset, sign, is_boolean, row = struct.unpack("<qqqdqq", beside[-6 * 8 :])
    assert (storage, call, sign, is_boolean, row) == (*struct.unpack("<qqqdq", place)[:2], 1.0, 0, 0)
    assert offset == 8 * description.slot(second).offset
    assert encoding.fixed_elements(description, [first], [first]) == []


def test_a_negated_alias_has_the_other_sign() -> None:
    info = ModelInfo("M", fmi_version="1.0")
    slots = {"a": Slot(0, "Real"), "b": Slot(0, "Real", negated=True)}
    table = encoding.ports(Description(info, "", {}, slots), ["a", "b"])
    assert struct.unpack("<qqqdqqqqdq", table[-80:])[3::5] == (1.0, -1.0)
