from falsifier.counterexamples.export.arrays import by_declaration, start_of
from falsifier.fmu import FmuModel
from falsifier.testing import lag_problem
from tests.fmu import fixtures


def test_arrays_are_completed() -> None:
    model = FmuModel(fixtures.path("Arrays_3"))
    given = {"A[1,2]": 5.0, "offset[1]": 1.0}
    assert by_declaration(model, given, lambda name: start_of(model, name)) == {
        "A": [0.0, 5.0, -1.0, 0.0],
        "offset": [1.0, 20.0],
    }


def test_aliases_appear_under_the_name_that_is_declared() -> None:
    model = FmuModel(fixtures.path("Aliases_3"))
    assert model.place("plant.y") == ("y", 0)
    assert model.elements("y") == ("y",)
    assert by_declaration(model, {"u": 1.0}, lambda name: 0.0) == {"u": [1.0]}


def test_other_models_have_no_arrays() -> None:
    assert by_declaration(lag_problem().model, {"x[1]": 2.0}, lambda name: 0.0) == {"x[1]": [2.0]}
