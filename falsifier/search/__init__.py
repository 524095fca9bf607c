"""The loop that asks an engine, simulates and judges within a budget, and what it needs and returns."""

# Maximum number of simulations of a run if nothing else is said. It stands here because options of the
# command line need nothing else of the search.
DEFAULT_SIMULATIONS = 100
