"""The loop that asks an engine, simulates and judges within a budget, and what it needs and returns."""
