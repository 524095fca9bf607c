"""What the compiled loops report when a component fails, at each stage."""

import pytest

from falsifier.core.signals import Signal
from falsifier.errors import SimulationError
from tests.fmu.small_systems import run, system
from tests.fmu.support import DISCARD, END, ERROR


@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize(
    ("fmu", "misdeed"), [("Misdeeds_2", ERROR), ("Misdeeds_2", DISCARD), ("Misdeeds_3", ERROR)]
)
def test_the_component_and_the_time_of_a_failure_are_told(method: str, fmu: str, misdeed: int) -> None:
    from falsifier.fmu import Coupling

    model = system({"plant": "Plant_2", "bad": fmu}, {"plant.u": "bad.y"}, Coupling(method))  # type: ignore[arg-type]
    with pytest.raises(
        SimulationError, match=r"^bad: the step returned (error|discard) at t = 0\.5 s"
    ) as failed:
        run(model, "plant.x", parameters={"bad.misdeed": misdeed})
    assert failed.value.time == 0.5


def test_a_component_that_ends_the_simulation_is_named() -> None:
    model = system({"good": "Plant_2", "bad": "Misdeeds_3"}, {})
    with pytest.raises(SimulationError, match=r"^bad: the FMU terminated the simulation at t = 0\.6 s"):
        run(model, "bad.y", parameters={"bad.misdeed": END})


def test_values_recorded_between_own_steps_are_those_that_the_others_see() -> None:
    from tests.fmu.small_systems import component

    slow = component("Ticker_3", 0.5)
    model = system({"slow": slow, "plant": "Plant_2"}, {"plant.u": "slow.sampled"})
    found = run(model, "slow.sampled", "slow.x", signals={"slow.u": Signal((0.0,), (4.0,))})
    for name in ("slow.sampled", "slow.x"):
        assert len(set(found[name][0:5])) == 1 and len(set(found[name][5:10])) == 1
