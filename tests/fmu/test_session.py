"""One instance simulated again and again: what makes the second run equal to the first."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from falsifier.core.model import Experiment
from falsifier.errors import ModelError, SimulationError
from falsifier.fmu.buffers import Room
from falsifier.fmu.description import archive
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.instance import FmuInstance
from falsifier.fmu.library import Library
from falsifier.fmu.plan import make_plan
from falsifier.fmu.session import Session
from falsifier.fmu.worker_order import Reuse
from tests.fmu import fixtures
from tests.fmu.fixtures import isolated, run
from tests.fmu.support import ERROR
from tests.patience import HANG

WAYS: list[tuple[str, Reuse]] = [
    ("Lag_2", "reset"),
    ("NoReset_2", "instance"),
    ("LyingReset_2", "instance"),
    ("SavedState_2", "state"),
    ("SavedState_3", "state"),
    ("LyingState_2", "instance"),
    ("SpentState_3", "instance"),
    ("KeepsStatic_2", "library"),
]


@contextmanager
def prepared(name: str, folder: Path, parameters: tuple[str, ...] = ()) -> Iterator[tuple[Session, Room]]:
    path = fixtures.path(name)
    archive.extract(path, folder)
    description = read_description(path)
    session = Session(lambda: FmuInstance(description, folder, "co-simulation", lambda _: None))
    plan = make_plan(description, Experiment(1.0, 0.1, ("y",), time_limit=HANG), [], parameters)
    room = Room.over(plan, np.zeros(Room.size(plan)))
    session.prepare(plan, room)
    yield session, room
    session.close()


@pytest.mark.parametrize(("name", "reuse"), WAYS)
def test_the_cheapest_way_that_gives_the_same_again_is_found(name: str, reuse: Reuse, tmp_path: Path) -> None:
    with prepared(name, tmp_path) as (session, room):
        session.run()
        first = room.outputs.copy()
        assert session.find_reuse() == session.reuse == reuse
        np.testing.assert_array_equal(room.outputs, first, "the outcome stays where it is")
        if reuse != "process":
            for _ in range(3):
                room.outputs[:] = 0.0
                session.run()
                np.testing.assert_array_equal(room.outputs, first)


def test_after_a_failed_run_the_next_one_starts_from_a_new_instance(tmp_path: Path) -> None:
    with prepared("Misdeeds_2", tmp_path, ("misdeed",)) as (session, room):
        room.parameters[0] = ERROR
        with pytest.raises(SimulationError, match="returned error"):
            session.run()
        room.parameters[0] = 0
        session.run()
        assert room.outputs.tolist() == [list(range(11))]


@pytest.mark.parametrize("name", [name for name, _ in WAYS])
def test_in_a_process_of_its_own_repeated_runs_are_equal(name: str) -> None:
    model = isolated(name)
    runs = [run(model, ("y",))["y"].tolist() for _ in range(4)]
    assert runs == [runs[0]] * 4
    model.close()


def test_an_instance_that_cannot_be_replaced_is_a_failed_simulation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_library: Library) -> None:
        raise ModelError("instantiating the FMU failed")

    with prepared("NoReset_2", tmp_path) as (session, room):
        session.run()
        first = room.outputs.copy()
        with monkeypatch.context() as broken:
            broken.setattr(Library, "renew", fail)
            with pytest.raises(SimulationError, match="instantiating the FMU failed"):
                session.run()
        session.run()
        np.testing.assert_array_equal(room.outputs, first)
