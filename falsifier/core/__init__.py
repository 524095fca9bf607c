"""The values that all other packages use: signals, search spaces, candidates, trajectories, models."""
