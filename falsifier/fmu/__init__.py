"""FMUs: reading their description, stepping them, and isolating them in processes of their own."""

from falsifier.fmu.description.model_description import read_info as read_info
from falsifier.fmu.model import (
    FmuModel as FmuModel,
    fmu_files as fmu_files,
    fmus_sha256 as fmus_sha256,
    is_packaged as is_packaged,
    is_solved as is_solved,
)
from falsifier.fmu.process.network import Coupling as Coupling
from falsifier.fmu.process.registry import rights_text as rights_text, stop_simulations as stop_simulations
from falsifier.fmu.process.rights import Rights as Rights, resolved as resolved, with_paths as with_paths
from falsifier.fmu.process.worker import watching as watching
from falsifier.fmu.ssp.reader import is_package as is_package, read_package as read_package
from falsifier.fmu.systems.components import Component as Component, Connection as Connection, Frame as Frame
from falsifier.fmu.systems.system import System as System
