"""Trains the controller of development/Crane.mo and prints its weights, as they stand there.

A network of eight tanh units learns by gradient descent what a saturated linear-quadratic regulator commands
in random states of the crane. It learns it only roughly: its errors are part of the system.

    python -m bench.train_crane
"""

import argparse

import numpy as np
from scipy.linalg import solve_continuous_are

ROPE, GRAVITY, LIMIT, UNITS = 8.0, 9.81, 1.5, 8
# Typical sizes of the distance to go [m], speed [m/s], angle [rad] and angular speed [rad/s].
SCALE = np.array([10.0, 4.0, 0.3, 0.3])


def regulator() -> np.ndarray:
    """Return the gains from the four states to the trolley's acceleration in m/s2, shape (4,)."""
    a = np.zeros((4, 4))
    a[0, 1], a[2, 3], a[3, 2] = -1.0, 1.0, -GRAVITY / ROPE
    b = np.array([[0.0], [1.0], [0.0], [-1.0 / ROPE]])
    cost = np.diag([0.1, 0.1, 30.0, 30.0])
    return np.asarray(-(b.T @ solve_continuous_are(a, b, cost, np.eye(1)))[0])


def train(steps: int = 20_000, seed: int = 7) -> list[np.ndarray]:
    """Return weights of the states (units, 4), offsets (units,) and weights of the units (units,)."""
    rng = np.random.default_rng(seed)
    weights = [rng.normal(0.0, 0.7, (UNITS, 4)), rng.normal(0.0, 0.5, UNITS), rng.normal(0.0, 0.5, UNITS)]
    first, second = ([np.zeros_like(w) for w in weights] for _ in range(2))
    gains = regulator() * SCALE
    for step in range(1, steps + 1):
        states = rng.uniform(-1.0, 1.0, (128, 4))
        wanted = np.clip(states @ gains / LIMIT, -1.0, 1.0)
        hidden = np.tanh(states @ weights[0].T + weights[1])
        error = (hidden @ weights[2] - wanted)[:, None] / len(states)
        back = error * weights[2] * (1.0 - hidden**2)
        slopes = [back.T @ states, back.sum(axis=0), (error * hidden).sum(axis=0)]
        for i, slope in enumerate(slopes):  # Adam
            first[i] = 0.9 * first[i] + 0.1 * slope
            second[i] = 0.999 * second[i] + 0.001 * slope**2
            size = np.sqrt(second[i] / (1.0 - 0.999**step)) + 1e-8
            weights[i] -= 0.003 * first[i] / (1.0 - 0.9**step) / size
    return weights


def main() -> None:
    """Print the weights as Modelica."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter).parse_args()
    for name, values in zip(("states", "offset", "units"), train(), strict=True):
        rows = [", ".join(f"{value:.6g}" for value in row) for row in np.atleast_2d(values)]
        print(name, "= {" + ("{" + "},\n  {".join(rows) + "}" if values.ndim == 2 else rows[0]) + "};")


if __name__ == "__main__":
    main()
