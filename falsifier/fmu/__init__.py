"""FMUs: reading their description, stepping them, and isolating them in processes of their own."""

from falsifier.fmu.description.model_description import read_info
from falsifier.fmu.model import FmuModel, fmu_files, fmus_sha256, is_packaged
from falsifier.fmu.process.network import Coupling
from falsifier.fmu.process.registry import rights_text, stop_simulations
from falsifier.fmu.process.rights import Rights, resolved
from falsifier.fmu.process.worker import watching
from falsifier.fmu.ssp.reader import is_package, read_package
from falsifier.fmu.systems.components import Component, Connection, Frame
from falsifier.fmu.systems.system import System

__all__ = [
    "Component",
    "Connection",
    "Coupling",
    "FmuModel",
    "Frame",
    "Rights",
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
]
