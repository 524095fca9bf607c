"""An FMU's shared library: loaded and instantiated with fmpy, called by function address."""

import ctypes
import os
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from falsifier.core.model import Interface
from falsifier.errors import ModelError
from falsifier.fmu.description import Description, archive, misnamed_text, missing_binary_text

_STATUS_NAMES = ("ok", "warning", "discard", "error", "fatal", "pending")
# Type codes by FMI version; they name the functions that read and write values.
TYPES: Mapping[int, tuple[str, ...]] = {
    1: ("Real", "Integer", "Boolean"),
    2: ("Real", "Integer", "Boolean"),
    3: ("Float64", "Float32", "Boolean", *(f"{u}Int{n}" for u in ("", "U") for n in (8, 16, 32, 64))),
}

LogSink = Callable[[str], None]


def status_name(status: int) -> str:
    """Return the name of an FMI status."""
    return (
        _STATUS_NAMES[status] if 0 <= status < len(_STATUS_NAMES) else f"status {ctypes.c_int(status).value}"
    )


def load_binding() -> None:
    """Import what loading any FMU needs, so that processes forked from this one need not."""
    from fmpy import fmi1, fmi2, fmi3, logging  # noqa: F401


class Library:
    """One loaded library with one instance.

    Args:
        description: description of the FMU.
        folder: folder to which the FMU was extracted.
        interface: interface to instantiate.
        log: called with each of the FMU's messages.
        logging: whether to ask the FMU for messages.

    Raises:
        ModelError: if the library is missing, cannot be loaded or cannot be instantiated.
    """

    def __init__(
        self,
        description: Description,
        folder: Path,
        interface: Interface,
        log: LogSink,
        *,
        logging: bool = False,
    ) -> None:
        self.description = description
        self.interface = interface
        self._log, self._logging = log, logging
        self._prefix = f"fmi{description.major}"
        binary = self._binary(folder)
        try:
            self._fmu = self._load(folder, binary)
        except Exception as error:
            raise ModelError(f"{description.info.name}: the library cannot be loaded: {error}") from error
        self._instantiate()

    @property
    def component(self) -> int:
        """Address of the instance."""
        component = self._fmu.component
        return int(getattr(component, "value", component))

    def address(self, name: str) -> int:
        """Return the address of an FMI function, named without ``fmi2``; 0 if it is not exported."""
        try:
            function = getattr(self._fmu.dll, self._symbol(name))
        except AttributeError:
            return 0
        return ctypes.cast(function, ctypes.c_void_p).value or 0

    def function(self, name: str, *argument_types: Any) -> Callable[..., int]:
        """Return an FMI function whose arguments are the instance and arguments of these types.

        Raises:
            ModelError: if the library does not export it.
        """
        address = self.address(name)
        if not address:
            raise ModelError(
                f"{self.description.info.name}: the library does not export {self._symbol(name)}"
            )
        # Unsigned, so that negative statuses, which FMI does not define, are larger than all others.
        prototype = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_void_p, *argument_types)
        return prototype(address)

    def getters(self) -> dict[str, int]:
        """Return the addresses of the functions that read values, by type code."""
        return {code: self.address(f"Get{code}") for code in TYPES[self.description.major]}

    def setters(self) -> dict[str, int]:
        """Return the addresses of the functions that write values, by type code."""
        return {code: self.address(f"Set{code}") for code in TYPES[self.description.major]}

    def renew(self) -> None:
        """Replace the instance with a new one from the same library."""
        self._free()
        self._instantiate()

    def close(self) -> None:
        """Free the instance and unload the library."""
        self._free()
        if self._log in _LISTENERS:
            _LISTENERS.remove(self._log)
        self._fmu.freeLibrary()

    def _symbol(self, name: str) -> str:
        if self.description.major == 1:
            # FMI 1 prefixes exported functions with the model identifier.
            return f"{self.description.identifiers[self.interface]}_fmi{name}"
        return self._prefix + name

    def _binary(self, folder: Path) -> Path:
        """Return the path of the library.

        Raises:
            ModelError: if there is none for this platform, or several with other names than expected.
        """
        info = self.description.info
        found = self.description.libraries.get(self.interface)
        if found is not None:
            return folder / found
        identifier = self.description.identifiers[self.interface]
        expected = archive.library_file(info.fmi_version, identifier)
        names = [p.relative_to(folder).as_posix() for p in folder.glob("binaries/*/*")]
        misnamed = misnamed_text(names, info.fmi_version, [identifier])
        if misnamed:
            raise ModelError(f"{info.name}: {misnamed}")
        has_sources = any((folder / "sources").rglob("*.c"))
        wine = self.description.needs_wine(self.interface)
        said = missing_binary_text("FMU", info.platforms, has_sources=has_sources, needs_wine=wine)
        raise ModelError(f"{info.name}: {said} ({expected} is missing)")

    def _load(self, folder: Path, binary: Path) -> Any:
        from fmpy import fmi1, fmi2, fmi3

        classes: dict[tuple[int, Interface], Any] = {
            (1, "co-simulation"): fmi1.FMU1Slave,
            (1, "model-exchange"): fmi1.FMU1Model,
            (2, "co-simulation"): fmi2.FMU2Slave,
            (2, "model-exchange"): fmi2.FMU2Model,
            (3, "co-simulation"): fmi3.FMU3Slave,
            (3, "model-exchange"): fmi3.FMU3Model,
        }
        return classes[self.description.major, self.interface](
            guid=self.description.token,
            modelIdentifier=self.description.identifiers[self.interface],
            unzipDirectory=str(folder),
            libraryPath=str(binary),
            instanceName=self.description.info.name,
            requireFunctions=False,
        )

    def _instantiate(self) -> None:
        # Some FMUs change the working directory when they are instantiated.
        here = Path.cwd()
        try:
            self._fmu.instantiate(**self._arguments())
        except Exception as error:
            raise ModelError(
                f"{self.description.info.name}: instantiating the FMU failed: {error}"
            ) from error
        finally:
            os.chdir(here)
        if not self._fmu.component:
            raise ModelError(f"{self.description.info.name}: instantiating the FMU failed")

    def _arguments(self) -> dict[str, Any]:
        arguments: dict[str, Any] = {"loggingOn": self._logging}
        if self.description.major == 3:
            arguments["logMessage"] = self._log_3
            if self.interface == "co-simulation":
                events = self.description.event_mode
                arguments |= {"eventModeUsed": events, "earlyReturnAllowed": events}
            return arguments
        arguments["functions" if self.description.major == 1 else "callbacks"] = self._callbacks()
        return arguments

    def _callbacks(self) -> Any:
        """Return the callbacks of FMI 1 and 2; fmpy's proxy expands the printf-style messages."""
        from fmpy import calloc, fmi1, fmi2, free

        version: Any = fmi1 if self.description.major == 1 else fmi2
        callbacks = getattr(version, f"{self._prefix}CallbackFunctions")()
        callbacks.logger = _logger(getattr(version, f"{self._prefix}CallbackLoggerTYPE"))
        callbacks.allocateMemory = getattr(version, f"{self._prefix}CallbackAllocateMemoryTYPE")(calloc)
        callbacks.freeMemory = getattr(version, f"{self._prefix}CallbackFreeMemoryTYPE")(free)
        try:
            from fmpy.logging import addLoggerProxy
        except (ImportError, OSError):
            return callbacks
        addLoggerProxy(ctypes.byref(callbacks))
        _LISTENERS[:] = [self._log]
        return callbacks

    def _log_3(self, _environment: object, status: int, _category: bytes, message: bytes) -> None:
        self._log(_line(status, message))

    def _free(self) -> None:
        if not self._fmu.component:
            return
        name = {
            (1, "co-simulation"): "FreeSlaveInstance",
            (1, "model-exchange"): "FreeModelInstance",
        }.get((self.description.major, self.interface), "FreeInstance")
        self.function(name)(self.component)
        self._fmu.component = None


# What hears the messages of FMI 1 and 2: the FMU that was instantiated last, or nothing once it is closed.
_LISTENERS: list[Callable[[str], None]] = []


@cache
def _logger(callback_type: Any) -> Any:
    """Return the logger of FMI 1 or 2.

    It is never freed: fmpy's proxy has one logger per process, which other FMUs call when this one has gone.
    """

    def log(_component: object, _name: bytes, status: int, _category: bytes, message: bytes) -> None:
        for listener in _LISTENERS or [print]:
            listener(_line(status, message))

    return callback_type(log)


def _line(status: int, message: bytes | None) -> str:
    text = (message or b"").decode("utf-8", "replace").strip()
    return f"{status_name(status)}: {text}"
