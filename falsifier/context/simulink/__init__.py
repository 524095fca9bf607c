"""Simulink files without MATLAB: what a ``.slx`` or ``.mdl`` file says of a model."""

from falsifier.context.simulink.diagram import Diagram
from falsifier.context.simulink.reader import read_diagram
from falsifier.context.simulink.summary import names_text, structure_text

__all__ = ["Diagram", "names_text", "read_diagram", "structure_text"]
