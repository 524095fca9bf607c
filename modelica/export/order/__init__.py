"""Flat model -> equations in the order of computation, variables in their places."""
