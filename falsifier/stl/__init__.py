"""Signal Temporal Logic: formulas, robustness, and what decided it."""
