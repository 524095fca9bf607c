"""Processes in which FMUs run, from the side of the process that requests simulations."""
