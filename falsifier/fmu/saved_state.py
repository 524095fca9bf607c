"""The saved state of a new FMU instance, from which later simulations can start (FMI 2 and 3)."""

from ctypes import addressof, byref, c_void_p

from falsifier.errors import ModelError
from falsifier.fmu.library import Library

_NAMES = {2: "FMUstate", 3: "FMUState"}


class SavedState:
    """A saved state of a library's instance; it must be freed before that instance.

    Args:
        library: the loaded library with its instance.
    """

    def __init__(self, library: Library) -> None:
        self._library = library
        self._name = _NAMES.get(library.description.major, "")
        self._state = c_void_p()

    @property
    def addresses(self) -> tuple[int, int, int]:
        """Addresses for compiled code: functions that save and restore, and the pointer to the state.

        Raises:
            ModelError: if the library does not export the functions.
        """
        get, restore = (self._library.address(f"{verb}{self._name}") for verb in ("Get", "Set"))
        if not (get and restore and self._library.address(f"Free{self._name}")):
            raise ModelError(
                f"{self._library.description.info.name}: the FMU declares that its state can be restored, "
                f"but its library does not export the functions for {self._name}"
            )
        return get, restore, addressof(self._state)

    @property
    def is_taken(self) -> bool:
        """Whether there is a state to start from."""
        return self._state.value is not None

    def take(self) -> bool:
        """Save the current state; return False if the FMU cannot do that."""
        if not all(self._library.address(f"{verb}{self._name}") for verb in ("Get", "Set", "Free")):
            return False
        get = self._library.function(f"Get{self._name}", c_void_p)
        return get(self._library.component, byref(self._state)) <= 1 and self.is_taken

    def restore(self) -> bool:
        """Restore the saved state; return False if there is none or the FMU reports an error."""
        if not self.is_taken:
            return False
        return self._library.function(f"Set{self._name}", c_void_p)(self._library.component, self._state) <= 1

    def forget(self) -> None:
        """Free the saved state; required before its instance is freed."""
        if self.is_taken:
            self._library.function(f"Free{self._name}", c_void_p)(self._library.component, byref(self._state))
            self._state.value = None
