import json

from falsifier.core.model import ModelInfo, Variable
from falsifier.fmu import read_info
from falsifier.views.model_text import info_json, info_text
from tests.fmu.fixtures import path as fmu_path


def test_all_variables_of_a_large_model_have_a_line_each() -> None:
    many = tuple(Variable(f"plant.x[{k}]", start=float(k)) for k in range(20_000))
    info = ModelInfo("large", variables=many)
    lines = info_text(info, everything=True).splitlines()
    assert len([line for line in lines if line.startswith("plant.x[")]) == 20_000
    assert info_text(info).splitlines()[-1] == "... and 19940 more; --all shows all other variables"
    assert len(json.loads(info_json(info))["variables"]) == 20_000


def test_columns_are_as_wide_as_their_cells_and_long_names_push_only_their_row() -> None:
    info = ModelInfo(
        "m", variables=(Variable("x", causality="output"), Variable("y" * 60, causality="output"))
    )
    header, short, long = info_text(info).splitlines()[-3:]
    assert header.index("type") == short.index("real") < long.index("real")


def test_unbounded_inputs_are_said_to_be_so() -> None:
    lines = info_text(read_info(fmu_path("HugeLimits_2"))).splitlines()
    (row,) = [line for line in lines if line.startswith("u ")]
    assert row.split() == ["u", "real", "m", "unbounded", "unbounded", "0"]


def test_what_is_unusual_is_noted() -> None:
    assert "note: the default experiment starts at 5 s" in info_text(read_info(fmu_path("LateStart_2")))


def test_without_outputs_all_variables_are_shown() -> None:
    text = info_text(read_info(fmu_path("NoOutputs_2dymola")))
    assert "\nother variables\n" in text
    assert "\ny  " in text
