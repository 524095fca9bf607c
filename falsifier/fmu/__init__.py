"""FMUs: reading their description, stepping them, and isolating them in processes of their own."""

from falsifier.fmu.description import read_info
from falsifier.fmu.model import FmuModel, fmu_files, fmus_sha256, is_packaged
from falsifier.fmu.process import Rights, resolved, rights_text, stop_simulations, watching
from falsifier.fmu.ssp import is_package, read_package
from falsifier.fmu.systems import Component, Connection, Coupling, Frame, System

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
