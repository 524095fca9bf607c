"""Processes in which FMUs run, from the side of the process that requests simulations."""

from falsifier.fmu.process import encoding, outcome
from falsifier.fmu.process.connection import Reply, Request, Where
from falsifier.fmu.process.order import FmuOrder, Order, is_held
from falsifier.fmu.process.plan import Plan, solver_tolerance
from falsifier.fmu.process.registry import (
    REGISTRY,
    Isolated,
    load,
    rights_text,
    simulate,
    stop_simulations,
)
from falsifier.fmu.process.rights import Rights, resolved
from falsifier.fmu.process.worker import watching
from falsifier.fmu.process.workplace import WorkFolder

__all__ = [
    "REGISTRY",
    "FmuOrder",
    "Isolated",
    "Order",
    "Plan",
    "Reply",
    "Request",
    "Rights",
    "Where",
    "WorkFolder",
    "encoding",
    "is_held",
    "load",
    "outcome",
    "resolved",
    "rights_text",
    "simulate",
    "solver_tolerance",
    "stop_simulations",
    "watching",
]
