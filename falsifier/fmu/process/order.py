"""What a worker is to simulate: one FMU here, or a system of several elsewhere."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from falsifier.core.model import Interface, Variable
from falsifier.errors import FalsifierError, ModelError
from falsifier.fmu.description import Description
from falsifier.fmu.process import encoding, outcome
from falsifier.fmu.process.connection import Reply, Request
from falsifier.fmu.process.encoding import integers, reals, text
from falsifier.fmu.process.plan import Plan, solver_tolerance
from falsifier.fmu.process.rights import Policy
from falsifier.fmu.process.shared import Room

_DEFAULT = Policy()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Order(ABC):
    """What a new worker needs to know, and how its replies are to be understood.

    Attributes:
        name: name of the model, for errors.
        path: the file, for errors; the name of a system.
        key: what tells models apart that cannot share a process.
        archives: FMUs to unpack and their hashes, by the folder that each is unpacked to; "" for the top.
        kind: the request with what ``load`` returns.
        logging: whether to ask the FMUs for messages.
        through_wine: whether to simulate the library for Windows.
        policy: what the FMUs may do.
    """

    name: str
    path: Path
    key: Hashable
    archives: Mapping[str, tuple[Path, str]]
    kind: Request
    logging: bool
    policy: Policy
    through_wine: bool = False

    @abstractmethod
    def load(self, folder: Path, *, logging: bool) -> bytes:
        """Return the request to load what was unpacked to a folder.

        Raises:
            ModelError: if there is no library for this machine.
        """

    @abstractmethod
    def prepare(self, plan: Plan) -> bytes:
        """Return the request to prepare for a plan's simulations."""

    @abstractmethod
    def checks(self, plan: Plan) -> Callable[[Room], None]:
        """Return what raises a SimulationError if a value in a room does not fit its variable's type."""

    def failure(self, plan: Plan, reply: Reply, refusals: str, log: tuple[str, ...]) -> FalsifierError:
        """Return the error for the reply to a simulation that failed; see ``outcome.failure``."""
        return outcome.failure(self.name, plan, reply, refusals, log)

    def component(self, position: int) -> str:
        """Return the name of the component at a position that a worker tells; empty for a single FMU."""
        del position
        return ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FmuOrder(Order):
    """One FMU to simulate.

    Attributes:
        description: its description.
        interface: interface to simulate with.
    """

    description: Description
    interface: Interface

    @classmethod
    def of(
        cls,
        path: Path,
        sha256: str,
        description: Description,
        interface: Interface,
        *,
        logging: bool = False,
        through_wine: bool = False,
        policy: Policy = _DEFAULT,
    ) -> "FmuOrder":
        """Return the order for an FMU whose file had this hash when the model was loaded."""
        return cls(
            name=description.info.name,
            path=path,
            key=(sha256, interface, logging, through_wine, policy),
            archives={"": (path, sha256)},
            kind=Request.LOAD,
            logging=logging,
            policy=policy,
            through_wine=through_wine,
            description=description,
            interface=interface,
        )

    def load(self, folder: Path, *, logging: bool) -> bytes:
        """See Order."""
        library = library_of(self.path, self.description, folder, self.interface, windows=self.through_wine)
        return encoding.fmu(
            self.description, folder, library, self.interface, logging=logging, through_wine=self.through_wine
        )

    def prepare(self, plan: Plan) -> bytes:
        """See Order."""
        d, slots = self.description, self.description.slots
        held, others = self._rows(plan)
        numbers = integers(
            plan.samples, plan.every, plan.pieces, len(plan.parameters), len(plan.inputs),
            plan.tolerance is not None,
        )  # fmt: skip
        times = reals(plan.stop_time, plan.max_step, plan.tolerance or 0.0, solver_tolerance(plan, d.info))
        parts = [numbers, times, integers(len(plan.strings))]
        parts += [integers(slots[name].reference) + text(value) for name, value in plan.strings]
        parts.append(encoding.ports(d, plan.parameters))
        for rows in (others, held):
            names = [plan.inputs[row] for row in rows]
            parts += [encoding.inputs(d, names, plan.parameters), integers(*rows)]
        parts.append(encoding.ports(d, plan.outputs))
        return b"".join(parts)

    def checks(self, plan: Plan) -> Callable[[Room], None]:
        """See Order."""
        rows = [list(zip(names, range(len(names)), strict=True)) for names in (plan.parameters, plan.inputs)]
        return value_checks(plan, [(self.description, rows[0], rows[1])])

    def _rows(self, plan: Plan) -> tuple[list[int], list[int]]:
        """Return the rows of the inputs that may change only at events, and those of the others."""
        kinds = {v.name: v for v in self.description.info.variables}
        held = [is_held(self.description, self.interface, kinds[name]) for name in plan.inputs]
        return [k for k, so in enumerate(held) if so], [k for k, so in enumerate(held) if not so]


# Variables of an FMU and the rows of a plan's parameters or inputs that have their values.
Rows = Sequence[tuple[str, int]]


# Name of an FMU, and names, limits and rows of some of its variables.
_Limited = tuple[str, list[str], NDArray[np.float64], list[int]]


def value_checks(plan: Plan, fmus: Iterable[tuple[Description, Rows, Rows]]) -> Callable[[Room], None]:
    """Return what raises a SimulationError if a value in a room does not fit its variable's type.

    Args:
        plan: what the simulations have in common.
        fmus: FMUs, with the rows of their parameters and of their inputs.
    """
    parameters: list[_Limited] = []
    inputs: list[_Limited] = []
    for description, own_parameters, own_inputs in fmus:
        parameters += _limited(description, own_parameters)
        inputs += _limited(description, own_inputs)

    def check(room: Room) -> None:
        for name, names, limits, rows in parameters:
            outcome.check_range(name, names, limits, room.parameters[rows, np.newaxis])
        for name, names, limits, rows in inputs:
            # Interpolated values are always between those at the ends of a piece.
            pieces = room.inputs[rows].reshape(len(rows), plan.pieces, 5)
            values = np.where(np.isfinite(pieces[:, :, 0]), pieces[:, :, 1], pieces[:, :1, 1])
            outcome.check_range(name, names, limits, values)

    return check


def _limited(description: Description, rows: Rows) -> Iterator[_Limited]:
    """Return, at most once, the FMU's name and the names, limits and rows of its limited variables."""
    limits = encoding.limits(description, [name for name, _ in rows])
    kept = np.flatnonzero(np.isfinite(limits).any(axis=1)).tolist()
    if kept:
        names, numbers = [rows[k][0] for k in kept], [rows[k][1] for k in kept]
        yield description.info.name, names, limits[kept], numbers


def is_held(description: Description, interface: Interface, variable: Variable) -> bool:
    """Whether an input may change only at events."""
    if interface == "co-simulation":
        return description.major == 3 and description.event_mode and variable.variability != "continuous"
    return not variable.is_continuous


def library_of(
    path: Path, description: Description, folder: Path, interface: Interface, *, windows: bool
) -> Path:
    """Return the path of the library of an FMU that was unpacked to a folder.

    Raises:
        ModelError: if there is none for this platform, or several with other names than expected.
    """
    libraries = description.libraries
    found = libraries.windows if windows else libraries.here
    if interface not in found:
        raise ModelError(f"{path}: {libraries.lacking[interface]}")
    return folder / found[interface]
