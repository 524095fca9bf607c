"""Arrays and dictionaries that several readers share, so that none can change them for the others."""

from collections.abc import Callable
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")


class FixedDict(dict[str, T]):
    """A dictionary by name that refuses to be changed."""

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("these values belong to a record and are read-only; dict(...) makes a copy to change")

    __setitem__ = __delitem__ = __ior__ = clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[dict[str, T]]]:
        return FixedDict, (dict(self),)


def fixed(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a view of an array through which it cannot be changed; other numbers become floats."""
    view = np.asarray(array, dtype=np.float64).view()
    view.flags.writeable = False
    return view
