from pathlib import Path

from falsifier.context.simulink.diagram import BlockSystem, Chart, Diagram, upstream
from falsifier.context.simulink.reader import read_diagram
from falsifier.context.simulink.summary import names_text, structure_text
from tests.fixtures import simulink


def test_names_have_no_parameters(tmp_path: Path) -> None:
    text = names_text(read_diagram(simulink.write_slx(tmp_path / "a.slx")))
    assert "inports disagreement, set point" in text
    assert "Controller: outports power" in text
    assert "Chart Mode logic: Normal, Limp, Limp.Frozen, Limp.Winding" in text
    assert "6.8" not in text


def test_structure_has_parameters_sources_and_conditions(tmp_path: Path) -> None:
    text = structure_text(read_diagram(simulink.write_slx(tmp_path / "a.slx")))
    for line in (
        "Model limphome (StopTime 40; Solver FixedStepDiscrete; FixedStep 0.1)",
        "- Controller: SubSystem <- Mode logic, Mode logic:2, set point, Bath",
        "- Bath: TransferFcn (Numerator = [80], Denominator = [40 1]) <- Controller 'power'",
        "- Limited: Switch (Criteria = u2 >= Threshold, Threshold = 0) <- Limit, limp, Command",
        "- start -> Limp.Frozen [age >= 1.5]",
        "- Normal -> Limp [disagreement > 6.8 && disagreement < 7.2]{age = t - ended;}",
        "- Scope: Scope, commented out",
    ):
        assert line in text.splitlines()
    assert "<- Error, enable: frozen" in text
    assert "stands for simulink/Sources/Counter Limited (not followed)" in text


def test_what_is_left_out_is_counted(tmp_path: Path) -> None:
    diagram = read_diagram(simulink.write_slx(tmp_path / "a.slx"))
    text = structure_text(diagram, upstream(diagram, ["power"]))
    assert "Safety switch" not in text
    assert "(4 blocks left out: no influence on the requirement)" in text


def test_a_matlab_function_is_told_with_its_code() -> None:
    text = structure_text(Diagram("m", BlockSystem(), (Chart("F", script="y = u > 3;"),)))
    assert text.endswith("MATLAB function F\n  y = u > 3;")
