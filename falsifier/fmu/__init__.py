"""FMUs: reading their description, stepping them, and isolating them in processes of their own."""

from falsifier.fmu.description import read_info
from falsifier.fmu.files import fmu_files, fmus_sha256, is_packaged, with_local_files
from falsifier.fmu.process import rights_text, stop_simulations, watching
from falsifier.fmu.process.policy import Policy, resolved
from falsifier.fmu.simulator import FmuModel
from falsifier.fmu.ssp import is_package, read_package
from falsifier.fmu.systems.network import Coupling, Frame
from falsifier.fmu.systems.system import Component, System
from falsifier.fmu.systems.wiring import Connection

__all__ = [
    "Component",
    "Connection",
    "Coupling",
    "FmuModel",
    "Frame",
    "Policy",
    "System",
    "fmu_files",
    "fmus_sha256",
    "is_package",
    "is_packaged",
    "read_info",
    "read_package",
    "resolved",
    "rights_text",
    "stop_simulations",
    "watching",
    "with_local_files",
]
