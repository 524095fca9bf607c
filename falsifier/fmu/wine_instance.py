"""A Windows library, simulated through Wine; the stepping is in worker/, see wine_process.py."""

import mmap
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np

from falsifier.core.model import Interface
from falsifier.errors import ModelError, SimulationError
from falsifier.fmu.buffers import Room
from falsifier.fmu.description import Description
from falsifier.fmu.description.wine import windows_path
from falsifier.fmu.library import TYPES, LogSink, status_name
from falsifier.fmu.plan import Plan, solver_tolerance
from falsifier.fmu.ports import Ports, make_ports
from falsifier.fmu.process import encoding
from falsifier.fmu.process.encoding import integers, reals, text
from falsifier.fmu.stepper import (
    check_input_range,
    check_range,
    is_held,
    loops,
    out_of_time,
    what_stopped,
)

if sys.platform != "win32":
    from falsifier.fmu.wine_process import Answer, WineProcess

assert sys.platform != "win32"

_LOAD, _PREPARE, _SIMULATE, _RESET, _TAKE, _RESTORE, _FORGET, _RENEW = range(1, 9)
# Where a simulation stopped, besides the places in loop_numbers.py; see ``enum where`` in worker.h.
_DONE = 0
_CALLING, _WRITING, _TEXT, _TIMEOUT, _IMPOSSIBLE = range(20, 25)


class WineInstance:
    """One FMU, loaded and instantiated under Wine; see Instance.

    Args:
        description: description of the FMU.
        folder: folder to which it was extracted.
        scratch: folder in which Wine may write.
        interface: interface to simulate with.
        log: called with each of the FMU's messages.
        logging: whether to ask the FMU for messages.

    Raises:
        ModelError: if Wine is not installed or the FMU cannot be loaded.
    """

    def __init__(
        self,
        description: Description,
        folder: Path,
        scratch: Path,
        interface: Interface,
        log: LogSink,
        *,
        logging: bool = False,
    ) -> None:
        self._description, self._interface = description, interface
        self._name = description.info.name
        self._plan: Plan | None = None
        self._saved = False
        self._rooms = 0
        self._wine = WineProcess(scratch, log)
        answer = self._wine.request(_LOAD, _fmu(description, folder, interface, logging=logging))
        if answer.where != _DONE:
            self._wine.close()
            raise ModelError(f"{self._name}: {answer.text}")

    @property
    def saves_state(self) -> bool:
        """See Instance."""
        return self._interface in self._description.saves_state

    @property
    def is_taken(self) -> bool:
        """See Instance."""
        return self._saved

    @property
    def memory_elsewhere(self) -> int:
        """See Instance; unknown here."""
        return 0

    def prepare(self, plan: Plan, room: Room) -> None:
        """See Instance."""
        self._room = room
        if plan is self._plan:
            return
        self._plan = None
        self._path = self._share(plan)
        kinds = {v.name: v for v in self._description.info.variables}
        held = [is_held(self._description, self._interface, kinds[name]) for name in plan.inputs]
        self._held_rows = [row for row, is_so in enumerate(held) if is_so]
        self._other_rows = [row for row, is_so in enumerate(held) if not is_so]
        self._parameters = self._ports(plan.parameters)
        self._inputs = self._ports([plan.inputs[row] for row in self._other_rows])
        self._held_inputs = self._ports([plan.inputs[row] for row in self._held_rows])
        self._send(plan)

    def _ports(self, names: Sequence[str]) -> Ports:
        codes = {code: position for position, code in enumerate(TYPES[self._description.major], start=1)}
        return make_ports(self._description, names, codes)

    def _send(self, plan: Plan) -> None:
        """Tell the worker what the next simulations have in common."""
        parts = [text(windows_path(self._path)), self._numbers(plan)]
        slots = self._description.slots
        parts += [integers(slots[name].reference) + text(value) for name, value in plan.strings]
        parts.append(encoding.ports(self._description, plan.parameters))
        for rows in (self._other_rows, self._held_rows):
            names = [plan.inputs[row] for row in rows]
            parts += [encoding.inputs(self._description, names, plan.parameters), integers(*rows)]
        parts.append(encoding.ports(self._description, plan.outputs))
        answer = self._wine.request(_PREPARE, b"".join(parts))
        if answer.where != _DONE:
            raise ModelError(f"{self._name}: {answer.text}")
        self._plan = plan

    def simulate(self, deadline: float) -> None:
        """See Instance."""
        plan, room, shared = self._plan, self._room, self._shared
        assert plan is not None, "prepare must be called before simulate"
        self._check_ranges(plan)
        shared.parameters[:] = room.parameters
        shared.inputs[:] = room.inputs
        remaining = max(deadline - time.perf_counter(), 0.0)
        self._check(plan, self._wine.request(_SIMULATE, reals(remaining)))
        room.outputs[:] = shared.outputs

    def reset(self) -> bool:
        """See Instance."""
        return self._wine.request(_RESET).where == _DONE

    def take(self) -> bool:
        """See Instance."""
        self._saved = self._wine.request(_TAKE).where == _DONE
        return self._saved

    def restore(self) -> bool:
        """See Instance."""
        return self._wine.request(_RESTORE).where == _DONE

    def forget(self) -> None:
        """See Instance."""
        if self._saved:
            self._wine.request(_FORGET)
            self._saved = False

    def renew(self) -> None:
        """See Instance."""
        answer = self._wine.request(_RENEW)
        if answer.where != _DONE:
            raise ModelError(f"{self._name}: {answer.text}")

    def close(self) -> None:
        """See Instance."""
        self._wine.close()

    def _share(self, plan: Plan) -> Path:
        """Make the file that both processes map, laid out as a Room; return its path."""
        self._rooms += 1
        path = self._wine.folder / f"room-{self._rooms}"
        size = Room.size(plan) * 8
        path.write_bytes(bytes(size))
        with path.open("r+b") as file:
            self._shared = Room.over(plan, np.frombuffer(mmap.mmap(file.fileno(), size), dtype=np.float64))
        return path

    def _numbers(self, plan: Plan) -> bytes:
        counts = integers(
            plan.samples, plan.every, plan.pieces, len(plan.parameters), len(plan.inputs),
            plan.tolerance is not None,
        )  # fmt: skip
        tolerance = solver_tolerance(plan, self._description.info)
        floats = reals(plan.stop_time, plan.max_step, plan.tolerance or 0.0, tolerance)
        return counts + floats + integers(len(plan.strings))

    def _check_ranges(self, plan: Plan) -> None:
        room = self._room
        if self._parameters.is_limited:
            check_range(self._name, plan.parameters, self._parameters, room.parameters[:, np.newaxis])
        pieces = room.inputs.reshape(len(plan.inputs), plan.pieces, 5)
        for ports, rows in ((self._inputs, self._other_rows), (self._held_inputs, self._held_rows)):
            check_input_range(self._name, [plan.inputs[row] for row in rows], ports, pieces[rows])

    def _check(self, plan: Plan, answer: Answer) -> None:
        """Raise the error for an outcome, in the words of the loops for this platform."""
        where, status, said = answer.where, answer.status, answer.text
        if where == _DONE:
            return
        if where == _IMPOSSIBLE:
            raise ModelError(f"{self._name}: {said}")
        if where == _TIMEOUT:
            raise out_of_time(self._name, plan, answer.time)
        returned = f"returned {status_name(status)}"
        if where == _CALLING:
            reason = f"{said} {returned} at the start of the simulation"
        elif where == _WRITING:
            reason = f"setting the {said} {returned}"
        elif where == _TEXT:
            name, value = plan.strings[int(said)]
            reason = f"setting {name!r} to {value!r} {returned}"
        else:
            stopped = what_stopped(loops(), status, where)
            reason = f"{stopped} at t = {answer.time:g} s, before the stop time {plan.stop_time:g} s"
        raise SimulationError(f"{self._name}: {reason}", time=answer.time)


def _fmu(description: Description, folder: Path, interface: Interface, *, logging: bool) -> bytes:
    library = folder / description.windows_libraries[interface]
    resources = {
        1: "file:///Z:" + quote(str(folder)),
        2: "file:///Z:" + quote(str(folder / "resources")),
        3: windows_path(folder / "resources") + "\\",
    }[description.major]
    events = description.major == 3 and interface == "co-simulation" and description.event_mode
    numbers = integers(
        description.major, interface == "model-exchange", logging, events, description.states,
        description.indicators,
    )  # fmt: skip
    words = (
        windows_path(library), description.identifiers[interface], description.info.name, description.token,
        resources,
    )  # fmt: skip
    return numbers + b"".join(map(text, words))
