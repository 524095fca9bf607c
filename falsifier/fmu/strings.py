"""Setting string parameters, such as the names of the files that a model reads."""

import ctypes
from collections.abc import Sequence

from falsifier.errors import SimulationError
from falsifier.fmu.library import Library, status_name


def set_strings(library: Library, strings: Sequence[tuple[str, str]]) -> None:
    """Set string variables, given as pairs of name and text.

    Raises:
        SimulationError: if the FMU rejects one.
    """
    if not strings:
        return
    description = library.description
    sizes = (ctypes.c_size_t,) * (2 if description.major == 3 else 1)
    types = (ctypes.c_void_p, sizes[0], ctypes.c_void_p, *sizes[1:])
    setter = library.function("SetString", *types)
    # One call each, so that the message names the one that is rejected.
    for name, text in strings:
        reference = ctypes.c_uint32(description.slots[name].reference)
        value = ctypes.c_char_p(text.encode())
        arguments = (ctypes.addressof(reference), 1, ctypes.addressof(value), *(1 for _ in sizes[1:]))
        status = setter(library.component, *arguments)
        if status > 1:
            raise SimulationError(
                f"{description.info.name}: setting {name!r} to {text!r} returned {status_name(status)}",
                time=0.0,
            )
