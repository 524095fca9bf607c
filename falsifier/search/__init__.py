"""One run: the loop that asks an engine, simulates and judges within a budget, and its record on disk."""
