"""Flat model -> equations in the order of computation, and the memory layout of variables."""
