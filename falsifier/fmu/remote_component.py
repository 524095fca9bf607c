"""A component of a system in a process of its own; to the master it looks like one that is loaded here.

The process is forked from that of the master. What the compiled loops call goes through a box in memory that
both share (``remote_calls``), everything else, such as the calls around the stepping, over a pipe. If the
process ends by itself, that of the master ends in the same way: whoever waits for it then knows how, and
which component ran.
"""

import ctypes
import mmap
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from falsifier.core import linux, operating_system, posix
from falsifier.core.model import Interface
from falsifier.errors import FalsifierError, ModelError, SimulationError
from falsifier.fmu import remote_calls as calls
from falsifier.fmu.description import Description
from falsifier.fmu.instance import FmuInstance
from falsifier.fmu.library import TYPES, LogSink
from falsifier.fmu.lifecycle import make_lifecycle
from falsifier.fmu.systems.network import Member

assert sys.platform == "linux"

# The system's status of a process has four bytes of the eight of a word.
_HALF = 0xFFFF_FFFF


class RemoteLibrary:
    """The library of a component in another process; see Library."""

    def __init__(self, description: Description, interface: Interface, process: "_Process") -> None:
        self.description, self.interface = description, interface
        self.component = process.box
        self._process = process
        self._names: list[str] = process.ask("functions")

    def address(self, name: str) -> int:
        """See Library; the address is that of a function that has it called in the other process."""
        return int(calls.stand_in(name, self.description.major).address) if name in self._names else 0

    def function(self, name: str, *argument_types: Any) -> Callable[..., int]:
        """See Library; arguments are numbers, or a pointer to a saved state."""

        def call(_component: int, *arguments: Any) -> int:
            pointed = [getattr(a, "_obj", None) for a in arguments]
            sent = [a if p is None else (p.value,) for a, p in zip(arguments, pointed, strict=True)]
            return int(self._process.ask("call", name, argument_types, sent))

        return call

    def getters(self) -> dict[str, int]:
        """See Library; of the types that the FMU's variables have."""
        return {code: self.address(f"Get{code}") for code in used_types(self.description)}

    def setters(self) -> dict[str, int]:
        """See Library; of the types that the FMU's variables have."""
        return {code: self.address(f"Set{code}") for code in used_types(self.description)}


def used_types(description: Description) -> list[str]:
    """Return the type codes of an FMU's numeric variables."""
    used = {slot.type for slot in description.slots.values()}
    return [code for code in TYPES[description.major] if code in used]


def warm_up(members: Sequence[Member]) -> None:
    """Load what components need, so that processes forked from this one need not."""
    for member in members:
        calls.warm_up(member.description.major, used_types(member.description))


class RemoteComponent:
    """One FMU, loaded and instantiated in a process of its own; see FmuInstance."""

    def __init__(
        self,
        description: Description,
        folder: Path,
        interface: Interface,
        log: LogSink,
        *,
        logging: bool = False,
    ) -> None:
        self._description, self._interface = description, interface
        self._process = _Process(lambda: FmuInstance(description, folder, interface, log, logging=logging))
        self.library = RemoteLibrary(description, interface, self._process)
        self.lifecycle = make_lifecycle(self.library)  # type: ignore[arg-type]

    @property
    def saves_state(self) -> bool:
        """See Instance."""
        return self._interface in self._description.saves_state

    @property
    def is_taken(self) -> bool:
        """See Instance."""
        return bool(self._process.ask("is_taken"))

    def set_strings(self, strings: Sequence[tuple[str, str]]) -> None:
        """See FmuInstance."""
        if strings:
            self._process.ask("set_strings", tuple(strings))

    def reset(self) -> bool:
        """See Instance."""
        return bool(self._process.ask("reset"))

    def take(self) -> bool:
        """See Instance."""
        return bool(self._process.ask("take"))

    def restore(self) -> bool:
        """See Instance."""
        return bool(self._process.ask("restore"))

    def forget(self) -> None:
        """See Instance."""
        self._process.ask("forget")

    def renew(self) -> None:
        """See Instance."""
        self._process.ask("renew")

    @property
    def memory_elsewhere(self) -> int:
        """See Instance."""
        return int(self._process.ask("memory"))

    def check(self) -> None:
        """End this process as that of the component has ended, if it has."""
        self._process.check()

    def close(self) -> None:
        """See Instance."""
        self._process.close()


class _Process:
    """The process of a component, and the box that it shares with this one."""

    def __init__(self, load: Callable[[], FmuInstance]) -> None:
        self._memory = mmap.mmap(-1, calls.BOX_BYTES)
        self._words = np.frombuffer(self._memory, dtype=np.int64)
        self.box = int(self._words.ctypes.data)
        libc = ctypes.CDLL(None)
        waiting = {calls.NANOSLEEP: "nanosleep", calls.YIELD: "sched_yield", calls.WAITPID: "waitpid"}
        for word, name in waiting.items():
            self._words[word] = ctypes.cast(getattr(libc, name), ctypes.c_void_p).value or 0
        self._pipe, theirs = Pipe()
        parent = os.getpid()
        self._pid = posix.fork()
        if not self._pid:
            self._pipe.close()
            _become_component(parent, theirs, self._words, load)
        self._words[calls.PID] = self._pid
        theirs.close()
        self._hear()

    def ask(self, what: str, *arguments: object) -> Any:
        """Have something done in the process, by Python.

        Raises:
            FalsifierError: as raised there.
        """
        self.check()
        calls.ask_other(self.box)
        try:
            self._pipe.send((what, arguments))
        except OSError:
            self._end_like_it()
        return self._hear()

    def check(self) -> None:
        """End this process as that of the component has ended, if the compiled loops have found that."""
        if self._words[calls.IS_GONE]:
            linux.end_like(int(self._words[calls.EXIT]) & _HALF)

    def close(self) -> None:
        """Free the instance and end the process."""
        self.ask("close")
        linux.await_end(self._pid)
        self._pipe.close()

    def _hear(self) -> Any:
        try:
            kind, result = self._pipe.recv()
        except (EOFError, OSError):
            self._end_like_it()
        if kind == "model":
            raise ModelError(result)
        if kind == "simulation":
            raise SimulationError(result, time=0.0)
        return result

    def _end_like_it(self) -> NoReturn:
        linux.end_like(linux.await_end(self._pid))


def _become_component(
    parent: int,
    pipe: Connection,
    words: "np.ndarray[Any, np.dtype[np.int64]]",
    load: Callable[[], FmuInstance],
) -> NoReturn:
    """Run this newly forked process as that of a component and exit."""
    code = 1
    try:
        linux.end_with_parent(parent)
        # The FMU could otherwise write to the connection of the master, or to those of other components.
        linux.close_others(pipe.fileno())
        try:
            instance = load()
        except FalsifierError as error:
            pipe.send(("model", str(error)))
        else:
            pipe.send(("", None))
            _serve(instance, pipe, words)
            code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def _serve(instance: FmuInstance, pipe: Connection, words: "np.ndarray[Any, np.dtype[np.int64]]") -> None:
    box = int(words.ctypes.data)
    while True:
        calls.serve(box, instance.library.component, instance.library.description.major)
        what, arguments = pipe.recv()
        try:
            reply = "", _done(instance, words, what, arguments)
        except SimulationError as error:
            reply = "simulation", str(error)
        except FalsifierError as error:
            reply = "model", str(error)
        calls.answered(box)
        pipe.send(reply)
        if what == "close":
            return


def _done(
    instance: FmuInstance,
    words: "np.ndarray[Any, np.dtype[np.int64]]",
    what: str,
    arguments: Sequence[Any],
) -> object:
    if what == "functions":
        return _functions(instance, words)
    if what == "call":
        name, types, sent = arguments
        given = [ctypes.byref(ctypes.c_void_p(*a)) if isinstance(a, tuple) else a for a in sent]
        return instance.library.function(name, *types)(instance.library.component, *given)
    if what == "memory":
        return operating_system.most_memory_used()
    found = getattr(instance, what)
    return found(*arguments) if callable(found) else found


def _functions(instance: FmuInstance, words: "np.ndarray[Any, np.dtype[np.int64]]") -> list[str]:
    """Write the addresses of the functions that compiled loops call to the box; return their names."""
    library = instance.library
    addresses = {name: library.address(name) for name in calls.names(library.description.major)}
    words[calls.FUNCTIONS : calls.FUNCTIONS + len(addresses)] = list(addresses.values())
    return [name for name, address in addresses.items() if address]
