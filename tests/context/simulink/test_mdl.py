import pytest

from falsifier.context.simulink.mdl import is_text_package, parse_mdl, text_parts
from falsifier.errors import SpecError
from tests.fixtures import simulink


def test_sections_values_and_pieces_of_text() -> None:
    text = 'Model {\n  Name "a \\"b\\"\\n"\n  "c"\n  Points [1, 2]\n  Simulink.X {\n    $Id 2\n  }\n}\n'
    model = parse_mdl(text, "a.mdl").children[0]
    assert model.values == {"Name": 'a "b"\nc', "Points": "[1, 2]"}
    assert (model.children[0].kind, model.children[0].values) == ("Simulink.X", {"$Id": "2"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('Model {\n  Name "a"\n', "the section Model of line 1 is not closed"),
        ("}\n", "line 1: a section is closed that was not opened"),
        ('Model {\n  Name "a\n}\n', "line 2: expected NAME VALUE"),
        ("Model {\n  ???\n}\n", "line 2: expected NAME VALUE"),
        ('Model {\n  "piece"\n}\n', "line 2: expected"),
        ("A {\n" * 300, "nested more than 200 deep"),
    ],
)
def test_errors_name_the_line(text: str, message: str) -> None:
    with pytest.raises(SpecError, match=f"a.mdl: .*{message}".replace("?", r"\?")):
        parse_mdl(text, "a.mdl")


def test_text_parts_are_those_of_the_package() -> None:
    text = simulink.text_package()
    assert is_text_package(text)
    assert not is_text_package(simulink.MDL)
    parts = text_parts(text)
    assert parts["simulink/systems/system_root.xml"].decode() == simulink.ROOT.rstrip()
    assert "metadata/thumbnail.png" not in parts  # binary
