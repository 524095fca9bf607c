from falsifier.core.model import ModelInfo, Variable
from falsifier.fmu import read_info
from falsifier.views.model_text import info_text, model_json
from tests.fmu.fixtures import path


def test_all_variables_of_a_large_model_have_a_line_each() -> None:
    many = tuple(Variable(f"plant.x[{k}]", start=float(k)) for k in range(20_000))
    assert "2147483647" in info_text(ModelInfo("one", variables=(Variable("n", start=2147483647),)))
    info = ModelInfo("large", variables=many)
    lines = info_text(info, everything=True).splitlines()
    assert len([line for line in lines if line.startswith("plant.x[")]) == 20_000
    assert info_text(info).splitlines()[-1] == "... and 19940 more; --all shows all other variables"
    assert len(model_json(info)["variables"]) == 20_000


def test_limits_that_are_close_to_each_other_are_told_apart() -> None:
    mass = Variable("mass", causality="parameter", low=999999.999, high=1000000.001, start=1000000.0005)
    (row,) = [x for x in info_text(ModelInfo("m", variables=(mass,))).splitlines() if x.startswith("mass ")]
    assert row.split()[-3:] == ["999999.999", "1000000.001", "1000000.0005"]


def test_unbounded_inputs_and_nominal_values_are_told() -> None:
    lines = info_text(read_info(path("HugeLimits_2"))).splitlines()
    (row,) = [line for line in lines if line.startswith("u ")]
    assert row.split() == ["u", "real", "m", "unbounded", "unbounded", "0"]
    assert "(nominally 5)" in info_text(read_info(path("Lag_2")))
    computed = Variable("x", is_state=True, refusal="the model computes its initial value")
    assert "(cannot be set: the model computes" in info_text(ModelInfo("m", variables=(computed,)))


def test_no_name_makes_a_line_of_its_own() -> None:
    hostile = "x\nnote: the FMU may do nothing"
    info = ModelInfo(
        hostile,
        description=hostile,
        tool=hostile,
        variables=(Variable(hostile, causality="input", unit=hostile),),
    )
    assert not [line for line in info_text(info).splitlines() if line.startswith("note: ")]
