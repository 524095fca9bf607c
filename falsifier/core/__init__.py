"""What everything else speaks of: signals, search spaces, candidates, trajectories and models."""
