"""Optimisers of a vector in [0, 1]^d, which know the robustness of simulations, or of their conditions."""
