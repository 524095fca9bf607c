"""What a worker is to simulate: one FMU here, or a system of several elsewhere."""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from pathlib import Path

from falsifier.core.model import Interface
from falsifier.errors import FalsifierError
from falsifier.fmu.description import Description
from falsifier.fmu.process import encoding, outcome
from falsifier.fmu.process.connection import Reply, Request
from falsifier.fmu.process.encoding import integers, reals, text
from falsifier.fmu.process.plan import Plan, solver_tolerance
from falsifier.fmu.process.rights import Rights


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Order(ABC):
    """What a new worker needs to know, and how its replies are to be understood.

    Attributes:
        description: variables of the FMU or system, and its name.
        shown: what errors of loading call it: the file of an FMU, the name of a system.
        key: what tells models apart that cannot share a process.
        archives: FMUs to unpack and their hashes, by the folder that each is unpacked to; "" for the top.
        kind: the request with what ``load`` returns.
        logging: whether to ask the FMUs for messages.
        through_wine: whether to simulate the library for Windows.
        rights: what the FMUs may do.
    """

    description: Description
    shown: str
    key: Hashable
    archives: Mapping[str, tuple[Path, str]]
    kind: Request
    logging: bool
    rights: Rights
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

    def failure(self, plan: Plan, reply: Reply, refusals: str, log: tuple[str, ...]) -> FalsifierError:
        """Return the error for the reply to a simulation that failed; see ``outcome.failure``."""
        return outcome.failure(plan, reply, refusals, log)

    def component(self, position: int) -> str:
        """Return the name of the component at a position that a worker tells; empty for a single FMU."""
        del position
        return ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FmuOrder(Order):
    """One FMU to simulate.

    Attributes:
        interface: interface to simulate with.
    """

    interface: Interface

    def load(self, folder: Path, *, logging: bool) -> bytes:
        """See Order."""
        return encoding.fmu(
            self.description,
            self.shown,
            folder,
            self.interface,
            logging=logging,
            through_wine=self.through_wine,
        )

    def prepare(self, plan: Plan) -> bytes:
        """See Order."""
        d, slots = self.description, self.description.slots
        held = {k for k, n in enumerate(plan.inputs) if is_held(d, self.interface, n)}
        others = [k for k in range(len(plan.inputs)) if k not in held]
        numbers = integers(
            plan.samples, plan.every, plan.pieces, len(plan.parameters), len(plan.inputs),
            plan.tolerance is not None,
        )  # fmt: skip
        times = reals(plan.stop_time, plan.max_step, plan.tolerance or 0.0, solver_tolerance(plan, d.info))
        parts = [numbers, times, integers(len(plan.strings))]
        parts += [integers(slots[name].reference) + text(value) for name, value in plan.strings]
        parts.append(encoding.ports(d, plan.parameters))
        for rows in (others, sorted(held)):
            names = [plan.inputs[row] for row in rows]
            parts += [encoding.inputs(d, names, plan.parameters), integers(*rows)]
        parts.append(encoding.ports(d, plan.outputs))
        return b"".join(parts)


def is_held(description: Description, interface: Interface, name: str) -> bool:
    """Whether an input may change only at events."""
    variable = description.info[name]
    if interface == "co-simulation":
        return description.major == 3 and description.event_mode and variable.variability != "continuous"
    return not variable.is_continuous
