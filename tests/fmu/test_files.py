from pathlib import Path

from falsifier.fmu import FmuModel, System, fmu_files, fmus_sha256, with_local_files
from falsifier.testing import lag_problem
from tests.fmu.fixtures import isolated, path
from tests.fmu.small_systems import loop


def test_files_of_a_model_are_known_with_their_hashes() -> None:
    lag = isolated("Lag_2")
    assert fmu_files(lag) == {lag.path: lag.sha256}
    assert list(fmu_files(loop())) == [path("Plant_2"), path("Gain_2")]
    assert fmu_files(lag_problem().model) == {}


def test_one_hash_for_all_files_does_not_depend_on_their_order() -> None:
    assert fmus_sha256([]) is None and fmus_sha256(["a"]) == "a" == fmus_sha256(["a", "a"])
    assert fmus_sha256(["a", "b"]) == fmus_sha256(["b", "a"]) != fmus_sha256(["a", "c"])


def test_models_are_read_from_the_copies_of_another_machine(tmp_path: Path) -> None:
    model = loop()
    copies = {}
    for found, digest in fmu_files(model).items():
        copies[digest] = tmp_path / digest / found.name
        copies[digest].parent.mkdir()
        copies[digest].write_bytes(found.read_bytes())
    moved = with_local_files(model, copies)
    assert isinstance(moved, System) and moved.key == model.key
    assert set(fmu_files(moved)) == set(copies.values())
    lag = with_local_files(isolated("Plant_2"), copies)
    assert isinstance(lag, FmuModel) and lag.path in copies.values()
    function = lag_problem().model
    assert with_local_files(function, copies) is function
