"""Processes in which FMUs run, from the side of the process that requests simulations."""

from falsifier.fmu.process.order import FmuOrder, Order, is_held
from falsifier.fmu.process.patience import watching
from falsifier.fmu.process.registry import REGISTRY, stop_simulations
from falsifier.fmu.process.reuse import REUSES, Reuse
from falsifier.fmu.process.room import Room
from falsifier.fmu.process.runner import Runner

__all__ = [
    "REGISTRY",
    "REUSES",
    "FmuOrder",
    "Order",
    "Reuse",
    "Room",
    "Runner",
    "is_held",
    "stop_simulations",
    "watching",
]
