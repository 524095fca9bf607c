"""Several connected FMUs as one model: components, connections, order of stepping."""

from falsifier.fmu.process import (
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
)
from falsifier.fmu.systems.components import Component, Connection, Frame
from falsifier.fmu.systems.step_order import late_links
from falsifier.fmu.systems.system import System

__all__ = [
    "SYSTEM",
    "Component",
    "Connection",
    "Coupling",
    "Extrapolation",
    "Frame",
    "Isolation",
    "Link",
    "Loops",
    "Member",
    "Method",
    "Network",
    "Place",
    "System",
    "late_links",
]
