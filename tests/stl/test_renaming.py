from falsifier.stl import parse
from falsifier.stl.renaming import renamed


def test_only_listed_names_change() -> None:
    formula = parse("G[0,2] (a + b <= 3 and F (abs(a) > c))")
    assert renamed(formula, {"a": "x", "d": "y"}) == parse("G[0,2] (x + b <= 3 and F (abs(x) > c))")


def test_names_can_be_exchanged() -> None:
    assert renamed(parse("a until b > 0"), {"a": "b", "b": "a"}) == parse("b until a > 0")
