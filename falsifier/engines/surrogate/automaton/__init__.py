"""A hybrid automaton learnt from trajectories: modes, guards and resets with located events."""
