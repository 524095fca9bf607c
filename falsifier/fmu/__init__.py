"""FMUs: reading their description, stepping them, and isolating them in processes of their own."""

from falsifier.fmu.description import read_info
from falsifier.fmu.files import fmu_files, fmus_sha256, with_local_files
from falsifier.fmu.network import Coupling
from falsifier.fmu.simulator import FmuModel
from falsifier.fmu.system import Component, System
from falsifier.fmu.wiring import Connection

__all__ = [
    "Component",
    "Connection",
    "Coupling",
    "FmuModel",
    "System",
    "fmu_files",
    "fmus_sha256",
    "read_info",
    "with_local_files",
]
