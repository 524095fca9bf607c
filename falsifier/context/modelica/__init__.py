"""Modelica sources: declarations and equations of classes, and what some variables depend on."""

from falsifier.context.modelica.classes import (
    ModelicaClass,
    class_for,
    class_text,
    conditions,
    slice_of,
    used_classes,
    with_bases,
)
from falsifier.context.modelica.reader import modified_values, read_modelica

__all__ = [
    "ModelicaClass",
    "class_for",
    "class_text",
    "conditions",
    "modified_values",
    "read_modelica",
    "slice_of",
    "used_classes",
    "with_bases",
]
