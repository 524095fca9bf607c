"""Processes in which FMUs run, from the side of the process that requests simulations."""

from falsifier.fmu.process import encoding, outcome
from falsifier.fmu.process.connection import Reply, Request, Where
from falsifier.fmu.process.order import FmuOrder, Order, is_held, library_of, value_checks
from falsifier.fmu.process.patience import watching
from falsifier.fmu.process.registry import REGISTRY, rights_text, stop_simulations
from falsifier.fmu.process.reuse import REUSES, Reuse
from falsifier.fmu.process.room import Room
from falsifier.fmu.process.runner import Runner

__all__ = [
    "REGISTRY",
    "REUSES",
    "FmuOrder",
    "Order",
    "Reply",
    "Request",
    "Reuse",
    "Room",
    "Runner",
    "Where",
    "encoding",
    "is_held",
    "library_of",
    "outcome",
    "rights_text",
    "stop_simulations",
    "value_checks",
    "watching",
]
