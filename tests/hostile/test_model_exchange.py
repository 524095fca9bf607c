"""Model-exchange FMUs that misbehave: each misdeed is a failed simulation with a reason, or does no harm."""

import sys
from collections.abc import Iterator

import pytest

from falsifier.core import posix
from falsifier.errors import ModelError, SimulationError
from falsifier.fmu import FmuModel
from falsifier.fmu.process import start
from falsifier.fmu.process.registry import REGISTRY
from tests.fmu.fixtures import isolated, path, run

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the test FMUs are built for Linux")

NAMES = ("Wild_1me", "Wild_2", "Wild_3")
# As in tests/fixtures/fmus/src/wild.h, in its order, with the reason that is given; none: it does no harm.
TOO_SMALL, ENDLESS = "no step is small enough", "its events never end"
MISDEEDS = {
    "nothing": "",
    "crash": "signal SIGSEGV",
    "hang": "time limit of 0.3 s",
    "exit": "exited with code 7",
    "not a number": TOO_SMALL,
    "infinite": TOO_SMALL,
    "vast": TOO_SMALL,
    "noise": TOO_SMALL,
    "fail": "the step returned error",
    "odd status": "the step returned status -1000",
    "discard": TOO_SMALL,
    "chatter": "",
    "bad indicator": "",
    "long indicators": "signal SIG",
    "past event": ENDLESS,
    "bad event": "",
    "far event": "",
    "dense events": ENDLESS,
    "endless": ENDLESS,
    "bad state": TOO_SMALL,
    "end": "terminated the simulation",
    "garbage": "",
    "null text": "",
    "long text": "",
    "crash at event": "signal SIGSEGV",
    "hang at event": "time limit of 0.3 s",
    "fast": "",
}


@pytest.fixture(params=NAMES, scope="module")
def wild(request: pytest.FixtureRequest) -> Iterator[FmuModel]:
    model = isolated(request.param, "model-exchange")
    run(model, ("x",))
    yield model
    model.close()


@pytest.mark.parametrize("misdeed", MISDEEDS)
def test_a_misdeed_costs_at_most_one_simulation(wild: FmuModel, misdeed: str) -> None:
    reason = MISDEEDS[misdeed]
    parameters = {"misdeed": float(list(MISDEEDS).index(misdeed))}
    limit = 0.3 if "hang" in misdeed else 60.0
    try:
        found = run(wild, ("x",), parameters=parameters, time_limit=limit)
        assert not reason
        assert found["x"][-1] == pytest.approx(1.0)
        assert sum(map(len, found.log)) < 100_000
    except SimulationError as error:
        assert reason and reason in str(error)
        assert len(str(error)) < 3000
    assert run(wild, ("x",))["x"][-1] == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["HOSTILE_STATES", "HOSTILE_INDICATORS"])
@pytest.mark.parametrize("number", [10**9, 2**64 - 1])
def test_a_wrong_number_of_states_or_indicators_is_no_defect(
    name: str, number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    REGISTRY.close()  # so that the next worker sees the variable
    monkeypatch.setenv(name, str(number))
    monkeypatch.setenv("FALSIFIER_FMU_VARIABLES", name)
    model = FmuModel(path("Wild_3"), "model-exchange")
    with pytest.raises(ModelError, match=r"Wild_3\.fmu: .* (states|indicators); expected 0 to"):
        run(model, ("x",))
    model.close()
    REGISTRY.close()


@pytest.mark.parametrize("misdeed", ["nothing", "fast"])
def test_many_states_need_memory_for_matrices_only_if_steps_are_implicit(
    misdeed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps remain explicit if there is too little; two matrices of 10,000 states have 1.6 GB."""
    REGISTRY.close()
    monkeypatch.setattr(start, "_MEMORY_SHARE", 1e9 / posix.machine_memory())
    monkeypatch.setenv("HOSTILE_STATES", "10000")
    monkeypatch.setenv("FALSIFIER_FMU_VARIABLES", "HOSTILE_STATES")
    model = FmuModel(path("Wild_3"), "model-exchange")
    parameters = {"misdeed": float(list(MISDEEDS).index(misdeed))}
    assert run(model, ("x",), parameters=parameters)["x"][-1] == pytest.approx(1.0)
    model.close()
    REGISTRY.close()
