"""What a new worker needs to know about the FMU that it will simulate."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from falsifier.core.model import Interface
from falsifier.fmu.description import Description

# How the next simulation starts: with the same instance after a reset or from its saved state, with a new
# instance, or in a new process.
Reuse = Literal["reset", "state", "instance", "process"]


@dataclass(frozen=True, slots=True)
class Order:
    """The FMU that a new worker simulates.

    Attributes:
        path: path of the FMU.
        sha256: hash of the file when the model was loaded.
        description: description of the FMU.
        interface: interface to simulate with.
        reuse: how the next simulation starts; None if not yet known.
    """

    path: Path
    sha256: str
    description: Description
    interface: Interface
    reuse: Reuse | None
