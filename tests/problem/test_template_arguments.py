import pytest

from falsifier.errors import FormulaError, SpecError
from falsifier.problem.shorthand import template_arguments
from falsifier.problem.spec import parse_spec


def test_arguments_are_read_as_in_toml_or_as_text() -> None:
    text = "settles signal=y2-y1 reference=80 within=2% after='brake > 0.5' during=[0,5] stays=1"
    assert template_arguments(text) == {
        "template": "settles",
        "signal": "y2-y1",
        "reference": 80,
        "within": "2%",
        "after": "brake > 0.5",
        "during": [0, 5],
        "stays": 1,
    }


def test_quotes_and_lists_are_those_of_toml() -> None:
    text = """never_together conditions=["a > 1", 'F[0,2] (b > 1)'] during=[0,5]"""
    assert template_arguments(text)["conditions"] == ["a > 1", "F[0,2] (b > 1)"]
    assert template_arguments("order conditions=['a','b']")["conditions"] == ["a", "b"]
    assert template_arguments("order during=[0, 5] on=true")["during"] == [0, 5]
    assert template_arguments("rise signal=car.'front left'.v")["signal"] == "car.'front left'.v"
    assert template_arguments("rise signal='\"G\"'")["signal"] == '"G"'
    assert template_arguments(f"rise time={'9' * 5000}")["time"] == "9" * 5000


@pytest.mark.parametrize("text", ["", "settles signal", "rise time=1 time=2", "rise signal='x"])
def test_what_is_no_template_says_how_to_write_one(text: str) -> None:
    with pytest.raises(FormulaError, match=r"--template: .*(key=value|write a template)"):
        template_arguments(text)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("signal", "speed +", "position"),
        ("within", "x", "percentage such as"),
        ("within", -1, "at least 0"),
        ("within", "nan%", "at least 0"),
        ("time", -1, "greater than or equal to 0"),
        ("after", -1, "time of at least 0"),
        ("after", "x >", "position"),
        ("signal", float("inf"), "finite"),
    ],
)
def test_each_argument_is_checked_where_it_stands(key: str, value: object, message: str) -> None:
    good = {"template": "settles", "signal": "x", "reference": 1, "within": 1, "time": 1}
    data = {"model": {"fmu": "a.fmu"}, "requirements": {"R": good | {key: value}}}
    with pytest.raises(SpecError, match=message) as raised:
        parse_spec(data, file="my.toml")
    assert raised.value.key == f"requirements.R.{key}"
