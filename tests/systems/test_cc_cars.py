"""The chasing cars as five FMUs against the same cars as one: what differs is what the coupling costs."""

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.evaluation.evaluate import evaluate
from tests.systems.coupling import distances, owned, problems, simulated
from tests.systems.driving import evenly, golden

CARS = {f"y{k}": f"car{k}.y" for k in range(1, 6)}
MONOLITHIC, COUPLED = problems("CC"), problems("CCcars")
SPACE = MONOLITHIC[0].space.fixed

# Control points that violate CC4 and CCx by more than the coupling can change.
DEEP = {
    "CC4": {
        "throttle": [0.9995, 0.0035, 0.0012, 0.0029, 0.0038, 0.0013, 0.0536, 0.0817, 0.5023, 0.078],
        "brake": [0.3431, 0.894, 0.666, 0.9983, 0.9984, 0.3233, 0.8256, 0.6939, 0.3339, 0.7079],
    },
    "CCx": {
        "throttle": [0.9917, 0.002, 0.0228, 0.0241, 0.7666, 0.4035, 0.1132, 0.7748, 0.3576, 0.3905],
        "brake": [0.3506, 0.8194, 0.2072, 0.6302, 0.5865, 0.3604, 0.1493, 0.2613, 0.9996, 0.5581],
    },
}
VIOLATING = golden("CC")["falsifying"] | DEEP


def candidates(number: int) -> list[Candidate]:
    low, high = SPACE.bounds.T
    rng = np.random.default_rng(3)
    return [SPACE.decode(rng.uniform(low, high)) for _ in range(number)]


def apart(candidate: Candidate, step: float) -> list[float]:
    """Largest distance in m between the two simulations, by car, both with this communication step."""
    one = simulated(MONOLITHIC[0], candidate, step=step)
    return list(distances(one, simulated(COUPLED[0], owned(candidate, "car1"), step=step), CARS).values())


def test_the_difference_is_proportional_to_the_communication_step() -> None:
    """A car sees the one ahead at communication points, so it changes its mode up to one step late."""
    coarse = np.median([apart(c, 0.01) for c in candidates(6)], axis=0)
    fine = np.median([apart(c, 0.0025) for c in candidates(6)], axis=0)
    assert coarse[0] < 1e-9 and fine[0] < 1e-9, "nobody is ahead of the leader"
    assert (coarse[1:] < 1.0).all(), "one step at some 50 m/s per change of mode"
    assert coarse[1:] / fine[1:] == pytest.approx(4.0, rel=0.6)


@pytest.mark.parametrize("name", ["CC1", "CC2", "CC3", "CC4", "CC5", "CCx"])
def test_each_requirement_is_violated_by_the_same_inputs(name: str) -> None:
    points = VIOLATING[name]
    candidate = Candidate({i: evenly(points[i], 100.0) for i in ("throttle", "brake")}, {})
    k = [problem.name for problem in MONOLITHIC].index(name)
    one = evaluate(MONOLITHIC[k], candidate).robustness
    five = evaluate(COUPLED[k], owned(candidate, "car1")).robustness
    assert one is not None and five is not None
    assert one < 0 and five < 0
    assert five == pytest.approx(one, abs=0.5)
