import pickle
import zipfile
from pathlib import Path

import pytest

from falsifier.errors import ModelError
from falsifier.fmu import Coupling, FmuModel, System, fmus_sha256
from tests.fmu import fixtures
from tests.fmu.fixtures import isolated, run
from tests.fmu.small_systems import loop, system

LAG, LOOP = isolated("Lag_2"), loop()


@pytest.mark.parametrize(
    ("model", "others"),
    [
        (LAG, [isolated("Lag_3"), FmuModel(LAG.path, "model-exchange")]),
        (LOOP, [loop(Coupling("jacobi")), loop(pi="Gain_3"), system({"plant": "Plant_2"}, {})]),
    ],
    ids=["FMU", "system"],
)
def test_models_travel_between_processes_and_are_equal_by_content(
    model: FmuModel | System, others: list[FmuModel | System]
) -> None:
    twin = pickle.loads(pickle.dumps(model))
    assert twin == model and hash(twin) == hash(model) and twin.order.key == model.order.key
    name = model.info.outputs[0].name
    assert run(twin, (name,))[name].tolist() == run(model, (name,))[name].tolist()
    assert all(other != model and other.order.key != model.order.key for other in others)


def test_a_file_that_changes_after_loading_is_refused(tmp_path: Path) -> None:
    copy = tmp_path / "model.fmu"
    copy.write_bytes(fixtures.path("Lag_3").read_bytes())
    with zipfile.ZipFile(copy, "a") as archive:
        archive.writestr("resources/note.txt", "another file than the others")
    model = FmuModel(copy)
    copy.write_bytes(fixtures.path("Ball_3").read_bytes())
    with pytest.raises(ModelError, match=r"model\.fmu: the file has changed since the model was loaded"):
        run(model, ("y",))


def test_no_binary_for_this_platform_says_what_there_is_and_what_to_do() -> None:
    with pytest.raises(
        ModelError, match=r"no binary for .*, nor for any other; .*compile them with `falsifier tools build"
    ):
        run(isolated("Lag_2sources"), ("y",))


def test_interfaces_that_are_not_there_name_the_one_that_is() -> None:
    with pytest.raises(ModelError, match='does not offer co-simulation; set interface = "model-exchange"'):
        FmuModel(fixtures.path("Stiff_2"))


def test_one_hash_for_all_files_does_not_depend_on_their_order() -> None:
    assert fmus_sha256([]) is None and fmus_sha256(["a"]) == "a" == fmus_sha256(["a", "a"])
    assert fmus_sha256(["a", "b"]) == fmus_sha256(["b", "a"]) != fmus_sha256(["a", "c"])
