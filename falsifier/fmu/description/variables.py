"""How to access one variable of an FMU."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Slot:
    """How to access one scalar in the FMU.

    Attributes:
        reference: value reference of the variable or, for an element, of its array.
        type: type code, e.g. ``Real``, ``Float32``, ``Boolean``.
        offset: position in the array in row-major order, 0 for scalars.
        size: number of elements of the array, 1 for scalars.
        negated: whether it is an FMI 1 alias with the opposite sign.
        refusal: why it cannot be set; empty if it can.
        declared: name in modelDescription.xml, if another: an array's for its elements, the variable's for
            aliases (FMI 3).
    """

    reference: int
    type: str
    offset: int = 0
    size: int = 1
    negated: bool = False
    refusal: str = ""
    declared: str = ""
