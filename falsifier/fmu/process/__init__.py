"""Processes in which FMUs run, from the side of the process that requests simulations."""

from falsifier.fmu.process import encoding, outcome
from falsifier.fmu.process.connection import Reply, Request, Where
from falsifier.fmu.process.folders import WorkFolder
from falsifier.fmu.process.order import FmuOrder, Order, is_held, library_of, value_checks
from falsifier.fmu.process.patience import watching
from falsifier.fmu.process.plan import Plan, Task, make_plan, make_task, room_for, run_task, solver_tolerance
from falsifier.fmu.process.registry import REGISTRY, rights_text, stop_simulations
from falsifier.fmu.process.rights import Policy, resolved
from falsifier.fmu.process.runner import Runner
from falsifier.fmu.process.shared import Room

__all__ = [
    "REGISTRY",
    "FmuOrder",
    "Order",
    "Plan",
    "Policy",
    "Reply",
    "Request",
    "Room",
    "Runner",
    "Task",
    "Where",
    "WorkFolder",
    "encoding",
    "is_held",
    "library_of",
    "make_plan",
    "make_task",
    "outcome",
    "resolved",
    "rights_text",
    "room_for",
    "run_task",
    "solver_tolerance",
    "stop_simulations",
    "value_checks",
    "watching",
]
