import pytest

from falsifier.core.model import Experiment
from falsifier.errors import ModelError, SimulationError
from falsifier.fmu import FmuModel
from tests.fmu import fixtures


def simulate(name: str, *strings: tuple[str, str]) -> None:
    model = FmuModel(fixtures.path(name))
    try:
        model.simulate({}, {}, Experiment(1.0, 0.1, ("y",), strings=strings))
    finally:
        model.close()


def test_a_string_that_the_fmu_rejects_is_named() -> None:
    # Lag_2 has no strings at all; its function for them returns an error.
    with pytest.raises(ModelError, match="'T' cannot be set to a text: it is not a single string"):
        simulate("Lag_2", ("T", "text"))


def test_an_unknown_string_is_told_with_the_most_similar_one() -> None:
    with pytest.raises(ModelError, match=r"no variable 'filename'.*fileName"):
        simulate("Table_2", ("filename", "text"))


def test_the_text_reaches_the_model() -> None:
    with pytest.raises(SimulationError, match="the table cannot be read"):
        simulate("Table_3", ("fileName", "/nowhere/gone.txt"))
