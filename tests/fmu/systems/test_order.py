"""What a worker's replies say of a system; it may send anything."""

import pytest

from falsifier.core.model import Experiment
from falsifier.errors import ModelError, SimulationError
from falsifier.fmu import Coupling
from falsifier.fmu.process import Policy, Reply, Where
from falsifier.fmu.process.plan import make_plan
from falsifier.fmu.systems.order import SystemOrder
from tests.fmu.small_systems import LOOP, system

MODEL = system({"table": "Table_3", "plant": "Lead_2", "pi": "Gain_2"}, LOOP, Coupling(loops="iterate"))
ORDER = SystemOrder.of(MODEL.network, MODEL.key, logging=False, policy=Policy())
STRINGS = (("table.fileName", "a.txt"),)
PLAN = make_plan(
    MODEL.network.description, Experiment(1.0, 0.1, ("plant.y",), strings=STRINGS), (), (), pieces=1
)
# Signals are plant.y and pi.y, in the order of stepping.
NAMES = [ORDER.component(k) for k in range(3)]


def told(reply: Reply) -> str:
    error = ORDER.failure(PLAN, reply, "", ("slow",))
    assert isinstance(error, SimulationError | ModelError)
    return str(error)


@pytest.mark.parametrize(
    ("where", "text", "said"),
    [
        (Where.NOT_A_NUMBER, "1", "pi: pi.y became nan at t = 0.5 s, before the stop time 1 s"),
        (Where.MISSING_AT_FIRST, " 0 1", "pi: plant.y, pi.y is nan at t = 0 s, in the initialisation"),
        (Where.MISSING_AFTER_START, "0", "pi: plant.y is nan at t = 0 s, after the initialisation"),
        (Where.RESTORING, "", "pi: saving or restoring the state returned error at t = 0.5 s"),
        (Where.STEPPING, "", "pi: the step returned error at t = 0.5 s"),
        (Where.TIMEOUT, "", "system: stopped at t = 0.5 s"),
        (Where.IMPOSSIBLE, "it lacks fmi2DoStep", "pi: it lacks fmi2DoStep"),
    ],
)
def test_the_component_and_its_outputs_are_named(where: Where, text: str, said: str) -> None:
    assert told(Reply(where, 3, text, 0.5, component=NAMES.index("pi"))).startswith(said)


def test_outputs_that_still_change_are_named_with_their_changes() -> None:
    moving = "9 0 0.25 1 1e-5"
    found = told(Reply(Where.NOT_CONVERGED, 0, moving, 0.5, component=NAMES.index("pi")))
    assert "the loop of pi, plant does not converge" in found
    assert "plant.y (by 0.25), pi.y (by 1e-05) and 7 more" in found
    found = told(Reply(Where.UNSETTLED, 0, moving, 0.0))
    assert "after 100 rounds" in found and "pi.y (by 1e-05) and 7 more" in found


@pytest.mark.parametrize("where", [*Where, 77])
@pytest.mark.parametrize("text", ["", "x", "1 99 y -1 ٣ 1e999 nan", "9" * 5000])
@pytest.mark.parametrize("component", [-1, 2, 10**8])
def test_nonsense_is_no_defect(where: int, text: str, component: int) -> None:
    assert told(Reply(where, 1 << 31, text, 0.5, component=component))
