"""Ordered model -> C."""
