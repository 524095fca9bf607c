"""Processes in which FMUs run, from the side of the process that requests simulations."""

from falsifier.fmu.process.network import (
    SYSTEM,
    Coupling,
    Extrapolation,
    Isolation,
    Link,
    Loops,
    Member,
    Method,
    Network,
    Place,
    full_name,
)
from falsifier.fmu.process.order import Order, own_steps
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
    "SYSTEM",
    "Coupling",
    "Extrapolation",
    "Isolated",
    "Isolation",
    "Link",
    "Loops",
    "Member",
    "Method",
    "Network",
    "Order",
    "Place",
    "Rights",
    "WorkFolder",
    "full_name",
    "load",
    "own_steps",
    "resolved",
    "rights_text",
    "simulate",
    "stop_simulations",
    "watching",
]
