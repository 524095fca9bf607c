"""Start, end and reset of a simulation: the calls that FMI 1, 2 and 3 require, in their order.

Parameters and start values are set before initialisation. Inputs are set within initialization mode (FMI 2
and 3), because there they may depend on nothing else, and the FMU computes its outputs and states from them.
"""

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Callable
from ctypes import byref, c_bool, c_char, c_double, c_int

from falsifier.errors import SimulationError
from falsifier.fmu.library import Library, status_name
from falsifier.fmu.plan import Plan

Step = Callable[[], None]


class EventInfo1(ctypes.Structure):
    """``fmiEventInfo`` of FMI 1."""

    _fields_ = (
        ("iteration_converged", c_char),
        ("references_changed", c_char),
        ("states_changed", c_char),
        ("terminate", c_char),
        ("has_next_time", c_char),
        ("next_time", c_double),
    )


class Lifecycle(ABC):
    """The calls before and after the stepping of one simulation.

    Attributes:
        first_events: events reported by the initialisation of FMI 1 model exchange; None for all others,
            which report them in event mode.
    """

    first_events: EventInfo1 | None = None

    def __init__(self, library: Library) -> None:
        self._call = _Calls(library)

    @abstractmethod
    def initialise(self, plan: Plan, set_parameters: Step, set_inputs: Step) -> None:
        """Initialise a new or reset instance, after which it can be stepped.

        Raises:
            SimulationError: if the FMU reports an error.
        """

    def terminate(self) -> None:
        """End the simulation; a bad status is ignored, because the trajectory is complete."""
        self._call.status("Terminate")

    def reset(self) -> bool:
        """Reset the instance to its state after instantiation; return False if the FMU cannot do that."""
        return self._call.try_reset("Reset")


class ModalLifecycle(Lifecycle):
    """The calls of FMI 2 and 3, whose initialisation mode lets inputs be set and outputs read repeatedly."""

    def initialise(self, plan: Plan, set_parameters: Step, set_inputs: Step) -> None:
        """See Lifecycle."""
        self.enter(plan, set_parameters)
        set_inputs()
        self.leave()

    @abstractmethod
    def enter(self, plan: Plan, set_parameters: Step) -> None:
        """Set the parameters and enter initialisation mode.

        Raises:
            SimulationError: if the FMU reports an error.
        """

    def leave(self) -> None:
        """Leave initialisation mode.

        Raises:
            SimulationError: if the FMU reports an error.
        """
        self._call("ExitInitializationMode")


def make_lifecycle(library: Library) -> Lifecycle:
    """Return the life cycle for the library's FMI version and interface."""
    if library.description.major == 3:
        return _Lifecycle3(library)
    if library.description.major == 2:
        return _Lifecycle2(library)
    return _Slave1(library) if library.interface == "co-simulation" else _Model1(library)


class _Calls:
    """Calls FMI functions and converts bad statuses to errors."""

    def __init__(self, library: Library) -> None:
        self._library = library
        self._functions: dict[str, Callable[..., int]] = {}

    def __call__(self, name: str, argument_types: tuple[object, ...] = (), *arguments: object) -> None:
        status = self.status(name, argument_types, *arguments)
        if status > 1:
            raise SimulationError(
                f"{self._library.description.info.name}: {name} returned {status_name(status)} "
                "at the start of the simulation",
                time=0.0,
            )

    def status(self, name: str, argument_types: tuple[object, ...] = (), *arguments: object) -> int:
        function = self._functions.get(name)
        if function is None:
            function = self._functions[name] = self._library.function(name, *argument_types)
        return function(self._library.component, *arguments)

    def try_reset(self, name: str) -> bool:
        return bool(self._library.address(name)) and self.status(name) <= 1


class _Lifecycle2(ModalLifecycle):
    def enter(self, plan: Plan, set_parameters: Step) -> None:
        set_parameters()
        self._call(
            "SetupExperiment",
            (c_int, c_double, c_double, c_int, c_double),
            plan.tolerance is not None,
            plan.tolerance or 0.0,
            0.0,
            1,
            plan.stop_time,
        )
        self._call("EnterInitializationMode")


class _Lifecycle3(ModalLifecycle):
    def enter(self, plan: Plan, set_parameters: Step) -> None:
        set_parameters()
        self._call(
            "EnterInitializationMode",
            (c_bool, c_double, c_double, c_bool, c_double),
            plan.tolerance is not None,
            plan.tolerance or 0.0,
            0.0,
            1,
            plan.stop_time,
        )


class _Slave1(Lifecycle):
    def initialise(self, plan: Plan, set_parameters: Step, set_inputs: Step) -> None:
        set_parameters()
        set_inputs()
        self._call("InitializeSlave", (c_double, c_char, c_double), 0.0, b"\x01", plan.stop_time)

    def terminate(self) -> None:
        self._call.status("TerminateSlave")

    def reset(self) -> bool:
        return self._call.try_reset("ResetSlave")


class _Model1(Lifecycle):
    def __init__(self, library: Library) -> None:
        super().__init__(library)
        self.first_events = self._events = EventInfo1()

    def initialise(self, plan: Plan, set_parameters: Step, set_inputs: Step) -> None:
        self._call("SetTime", (c_double,), 0.0)
        set_parameters()
        set_inputs()
        self._call(
            "Initialize",
            (c_char, c_double, ctypes.POINTER(EventInfo1)),
            b"\x01" if plan.tolerance is not None else b"\x00",
            plan.tolerance or 0.0,
            byref(self._events),
        )

    def terminate(self) -> None:
        self._call.status("Terminate")

    def reset(self) -> bool:
        # FMI 1 model exchange does not define a reset.
        return False
