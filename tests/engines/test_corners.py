from falsifier.engines import make_engine
from falsifier.testing import drive, lag_problem, simulated


def test_corners_come_first_and_each_once() -> None:
    problem = lag_problem(inputs=2, parameters=1)
    engine = make_engine("corners", problem, seed=1)
    asked = drive(engine, simulated(problem, lambda y: float(3 - y.max())), rounds=9)
    corners = {(*(s.values for s in c.signals.values()), *c.parameters.values()) for c in asked[:8]}
    assert len(corners) == 8
    assert all(abs(v) == 2.0 for c in asked[:8] for s in c.signals.values() for v in s.values)
    assert any(abs(v) != 2.0 for s in asked[8].signals.values() for v in s.values)
