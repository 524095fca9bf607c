"""One run: the loop that asks, simulates, judges and tells, within a budget, and its record on disk."""
