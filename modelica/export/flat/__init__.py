"""Syntax tree -> flat model of scalar equations."""
