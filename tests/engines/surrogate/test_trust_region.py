import numpy as np

from falsifier.engines.surrogate.trust_region import TrustRegion
from tests.engines.surrogate.support import SETTINGS


def test_trust_region_follows_the_best_and_ends() -> None:
    rng = np.random.default_rng(0)
    region = TrustRegion(4, SETTINGS)
    target = np.array([0.0, 1.0, 0.3, 0.6])
    costs = []
    for _ in range(60):
        point = region.ask(rng)
        costs.append(float(((point - target) ** 2).sum()))
        region.tell(point, costs[-1])
    assert min(costs) < 0.02 < min(costs[:16])
    stuck = TrustRegion(2, SETTINGS)
    for _ in range(80):
        stuck.tell(stuck.ask(rng), 1.0)
    assert stuck.is_exhausted
