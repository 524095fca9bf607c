"""Car and shift logic as two FMUs against the same as one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.evaluation.evaluate import evaluate
from falsifier.fmu import Component, Coupling, System
from tests.systems.coupling import distances, owned, problems, simulated
from tests.systems.driving import Array, evenly, golden

ONE, TWO = problems("AT"), problems("ATsplit")
NAMES = {"speed": "car.speed", "rpm": "car.rpm", "gear": "shift.gear"}
TICK, STOP = 0.04, 50.0
FALSIFYING = golden("AT")["falsifying"]


def driven(times: list[float], throttle: list[float], brake: list[float]) -> Candidate:
    """Pieces of throttle and brake that begin at these times."""
    values = {"throttle": throttle, "brake": brake}
    return Candidate({n: Signal(tuple(times), tuple(v), "constant") for n, v in values.items()}, {})


def shifts(gear: Array) -> Array:
    """Times of the shifts in s."""
    return np.asarray((np.flatnonzero(np.diff(gear)) + 1) * 0.01, dtype=np.float64)


def test_equal_if_inputs_do_not_jump_at_a_tick() -> None:
    rng = np.random.default_rng(11)
    times = [0.0, *(TICK * np.sort(rng.choice(1250, 12, replace=False)) + TICK / 2)]
    for _ in range(4):
        candidate = driven(times, rng.uniform(0, 100, 13).tolist(), rng.uniform(0, 325, 13).tolist())
        one, two = simulated(ONE[0], candidate), simulated(TWO[0], owned(candidate, "car"))
        assert len(shifts(one["gear"])) >= 5
        assert max(distances(one, two, NAMES).values()) < 1e-9


def test_a_jump_at_a_tick_acts_one_tick_later() -> None:
    """Full throttle at 20 s asks for a lower gear: AT repeats the tick of that time, two FMUs do not."""
    candidate = driven([0.0, 20.0], [40.0, 100.0], [0.0, 0.0])
    one, two = simulated(ONE[0], candidate), simulated(TWO[0], owned(candidate, "car"))
    early, late = shifts(one["gear"]), shifts(two["shift.gear"])
    assert early[early < 20.0] == pytest.approx(late[late < 20.0])
    assert late[late > 20.0][0] == pytest.approx(early[early > 20.0][0] + TICK)


def test_the_share_of_late_shifts_is_proportional_to_the_step() -> None:
    # With Jacobi and no step of its own, the shift logic sees the speed of one communication step before.
    # A shift is a tick late if the speed reaches its threshold within that step before a tick.
    system = TWO[0].model
    assert isinstance(system, System)
    parts = {name: Component(component.fmu) for name, component in system.parts.items()}
    coupled = replace(TWO[0], model=replace(system, components=parts, coupling=Coupling(method="jacobi")))
    candidates = [driven([0.0], [throttle], [0.0]) for throttle in np.linspace(30.0, 99.0, 100)]
    expected = np.array([shifts(simulated(ONE[0], c, stop=5.0)["gear"])[0] for c in candidates])
    for step in (0.01, 0.005):
        runs = [simulated(coupled, owned(c, "car"), step=step, stop=5.0) for c in candidates]
        found = np.array([shifts(run["shift.gear"])[0] for run in runs])
        delays = np.rint((found - expected) / TICK)
        assert delays.min() == 0 and delays.max() == 1
        assert delays.mean() == pytest.approx(step / TICK, abs=0.08)


@pytest.mark.parametrize("case", FALSIFYING, ids=lambda case: case["requirement"])
def test_each_requirement_is_violated_by_the_same_inputs(case: dict[str, Any]) -> None:
    signals = {name: replace(evenly(case[name], STOP), hold=0.05) for name in ("throttle", "brake")}
    candidate = Candidate(signals, {})
    k = [problem.name for problem in ONE].index(case["requirement"])
    assert TWO[k].name == f"ATsplit{case['requirement'].removeprefix('AT')}"
    robustness = evaluate(TWO[k], owned(candidate, "car")).robustness
    assert robustness is not None and robustness < 0
    assert robustness == pytest.approx(case["held"], abs=0.2)
