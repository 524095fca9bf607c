"""Optimisers of a vector in [0, 1]^d: what is known of a system is only the robustness of its simulations."""
