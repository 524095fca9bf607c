import pytest

from falsifier.fmu import worker
from falsifier.fmu.isolation import REGISTRY
from tests.fmu.fixtures import isolated, run


def test_workers_are_replaced_before_they_have_made_too_many_instances() -> None:
    model = isolated("NoReset_2")
    pids = set()
    for _ in range(worker._MAX_INSTANCES + 20):
        assert run(model, ("y",), stop=0.2)["y"].tolist() == [0, 1, 2]
        (fmu,) = [f for key, f in REGISTRY._fmus.items() if key[0] == model.sha256]
        pids |= {fmu._worker.pid} if fmu._worker else set()
    assert len(pids) == 2
    model.close()


@pytest.mark.parametrize("name", ["SavedState_2", "SavedState_3"])
def test_thousands_of_runs_start_from_one_saved_state_in_one_worker(name: str) -> None:
    model = isolated(name)
    run(model, ("y",), stop=0.2)
    run(model, ("y",), stop=0.2)  # takes note of the self-test
    (fmu,) = [f for key, f in REGISTRY._fmus.items() if key[0] == model.sha256]
    assert fmu._worker is not None
    pid = fmu._worker.pid
    for _ in range(5 * worker._MAX_INSTANCES):
        assert run(model, ("y",), stop=0.2)["y"].tolist() == [0, 1, 2]
    assert fmu._worker is not None and fmu._worker.pid == pid
    model.close()
