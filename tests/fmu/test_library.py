from collections.abc import Callable
from ctypes import byref, c_void_p
from pathlib import Path

import pytest

from falsifier.core.model import Interface
from falsifier.errors import ModelError
from falsifier.fmu.description import archive
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.library import Library, status_name
from tests.fmu import fixtures

Open = Callable[..., Library]


@pytest.fixture
def opened(tmp_path: Path) -> Open:
    """Load a test FMU."""

    def load(name: str, interface: Interface = "co-simulation") -> Library:
        path = fixtures.path(name)
        archive.extract(path, tmp_path / name)
        return Library(read_description(path), tmp_path / name, interface, lambda _: None)

    return load


@pytest.mark.parametrize(
    ("name", "interface", "types"),
    [
        ("Lag_1cs", "co-simulation", {"Real", "Integer", "Boolean"}),
        ("Lag_1me", "model-exchange", {"Real", "Integer", "Boolean"}),
        ("Lag_2", "co-simulation", {"Real", "Integer", "Boolean"}),
        ("Lag_3", "model-exchange", {"Float64", "Boolean", "Int8", "UInt64"}),
    ],
)
def test_functions_are_found_by_their_name_in_every_version(
    opened: Open, name: str, interface: Interface, types: set[str]
) -> None:
    library = opened(name, interface)
    assert library.component
    assert types <= {code for code, address in library.getters().items()}
    assert library.getters()["Float64" if name == "Lag_3" else "Real"]
    assert library.address("NoSuchFunction") == 0
    with pytest.raises(ModelError, match="NoSuchFunction"):
        library.function("NoSuchFunction")
    library.close()


def test_a_function_is_called_with_the_instance(opened: Open) -> None:
    library = opened("SavedState_2")
    state = c_void_p()
    assert library.function("GetFMUstate", c_void_p)(library.component, byref(state)) == 0
    assert state.value
    assert library.function("FreeFMUstate", c_void_p)(library.component, byref(state)) == 0
    library.close()


def test_an_instance_is_replaced_by_a_new_one(opened: Open) -> None:
    library = opened("Lag_2")
    library.renew()
    assert library.component
    assert library.function("Reset")(library.component) == 0
    library.close()


def test_a_library_that_cannot_be_loaded_names_the_model(tmp_path: Path) -> None:
    path = fixtures.path("Lag_2")
    archive.extract(path, tmp_path)
    description = read_description(path)
    file = tmp_path / archive.library_file("2.0", description.identifiers["co-simulation"])
    file.write_bytes(b"this is no library")
    with pytest.raises(ModelError, match=r"Lag: .*cannot be loaded"):
        Library(description, tmp_path, "co-simulation", lambda _: None)
    file.unlink()
    with pytest.raises(ModelError, match=r"Lag: .*Lag\.so"):
        Library(description, tmp_path, "co-simulation", lambda _: None)


def test_loading_leaves_the_working_folder_as_it_was(opened: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    before = Path.cwd()
    opened("Lag_2").close()
    assert Path.cwd() == before


def test_statuses_have_names() -> None:
    assert [status_name(s) for s in (0, 1, 3, 99)] == ["ok", "warning", "error", "status 99"]
