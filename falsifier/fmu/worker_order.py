"""Which FMU is to be run, and how: what a simulating process tells the one that simulates for it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from falsifier.core.model import Interface
from falsifier.fmu.description import Description

# How the next simulation starts: the same instance after a reset or from its saved state, a new instance,
# a new process.
Reuse = Literal["reset", "state", "instance", "process"]


@dataclass(frozen=True, slots=True)
class Order:
    """What a new worker is to run.

    Attributes:
        path: of the FMU.
        sha256: of the file as it was when the model was loaded.
        description: of the FMU.
        interface: how it is simulated.
        reuse: how instances may be used again, None if not known yet.
    """

    path: Path
    sha256: str
    description: Description
    interface: Interface
    reuse: Reuse | None
