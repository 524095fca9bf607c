"""Modelica text -> syntax tree."""
