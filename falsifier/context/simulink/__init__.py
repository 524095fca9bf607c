"""Simulink files without MATLAB: what a ``.slx`` or ``.mdl`` file says of a model."""

from falsifier.context.simulink.diagram import Diagram as Diagram
from falsifier.context.simulink.reader import read_diagram as read_diagram
from falsifier.context.simulink.summary import names_text as names_text, structure_text as structure_text
