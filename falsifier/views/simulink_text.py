"""What people see of a Simulink file: its structure as text, its content as JSON."""

import json
from dataclasses import asdict

from falsifier.context.simulink import Diagram, structure_text
from falsifier.core.words import counted


def simulink_text(diagram: Diagram) -> str:
    """Return how much a diagram contains, and its structure."""
    systems = [system for _, system in diagram.root.walk()]
    size = (
        f"{counted(sum(len(system.blocks) for system in systems), 'block')} in "
        f"{counted(len(systems), 'system')}, {counted(len(diagram.charts), 'chart')}"
    )
    return f"{size}\n{structure_text(diagram)}"


def simulink_json(diagram: Diagram) -> str:
    """Return the content of a diagram as JSON."""
    return json.dumps(asdict(diagram), indent=2)
