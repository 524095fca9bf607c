"""The saved state of a new FMU instance, from which later simulations can start (FMI 2 and 3)."""

from ctypes import byref, c_void_p

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
            self._state = c_void_p()
