"""What a new worker needs to know about the FMU or the system that it will simulate."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from falsifier.core.model import Interface
from falsifier.fmu.description import Description
from falsifier.fmu.systems.network import Network

# How the next simulation starts, the cheapest first: with the same instance after a reset or from its saved
# state, with a new instance, with the library loaded again, or in a new process.
Reuse = Literal["reset", "state", "instance", "library", "process"]
REUSES: tuple[Reuse, ...] = get_args(Reuse)


@dataclass(frozen=True, slots=True)
class Order:
    """The FMU or system that a new worker simulates.

    Attributes:
        path: path of the FMU; the name of a system.
        sha256: hash of the file when the model was loaded; of a system, its key.
        description: description of the FMU, or of the system as a whole.
        interface: interface to simulate with.
        reuse: how the next simulation starts; None if not yet known.
        untrusted: ways to start that made the FMU crash or hang; they are not tried again.
        logging: whether to ask the FMU for messages.
        through_wine: whether to simulate the library for Windows.
        network: components and connections of a system; None for a single FMU.
    """

    path: Path
    sha256: str
    description: Description
    interface: Interface
    reuse: Reuse | None
    untrusted: tuple[Reuse, ...] = ()
    logging: bool = False
    through_wine: bool = False
    network: Network | None = None
