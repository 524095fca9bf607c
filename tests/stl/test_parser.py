import pickle
import random

import pytest
from hypothesis import given, settings, strategies as st

from falsifier.errors import FormulaError
from falsifier.stl import formula as stl, parse
from falsifier.stl.expression import Arithmetic, Name, Number
from falsifier.stl.lexer import name_text
from tests.stl.randoms import random_formula

A, B, C = (stl.Flag.of(Name(n)) for n in "abc")
X3 = stl.Predicate("<=", Name("x"), Number(3.0))


@pytest.mark.parametrize(
    ("text", "tree"),
    [
        ("a -> b -> c", stl.Implies(A, stl.Implies(B, C))),
        ("a => b", stl.Implies(A, B)),
        ("a <-> b <=> c", stl.Iff(stl.Iff(A, B), C)),
        ("a or b and c", stl.Or(A, stl.And(B, C))),
        ("a | b & c", stl.Or(A, stl.And(B, C))),
        ("a || b && c", stl.Or(A, stl.And(B, C))),
        ("a and b and c", stl.And(stl.And(A, B), C)),
        ("not a and b", stl.And(stl.Not(A), B)),
        ("!a -> b", stl.Implies(stl.Not(A), B)),
        ("not x <= 3", stl.Not(X3)),
        ("a U b U c", stl.Until(A, stl.Until(B, C))),
        ("a U[0,1] b and c", stl.And(stl.Until(A, B, stl.Window(0, 1)), C)),
        ("not a U b", stl.Until(stl.Not(A), B)),
        ("G[0,5] x <= 3 -> a", stl.Implies(stl.Always(X3, stl.Window(0, 5)), A)),
        ("always[0,5] a", stl.Always(A, stl.Window(0, 5))),
        ("eventually a", stl.Eventually(A)),
        ("a until[1,2] b", stl.Until(A, B, stl.Window(1, 2))),
        ("next X a", stl.Next(stl.Next(A))),
        ("G F a", stl.Always(stl.Eventually(A))),
        ("1 <= x <= 3", stl.And(stl.Predicate("<=", Number(1), Name("x")), X3)),
        ("(((x))) <= (3)", X3),
        ("(x) + 1 <= 3", stl.Predicate("<=", Arithmetic("+", Name("x"), Number(1)), Number(3))),
        ("x^2<=9", stl.Predicate("<=", Arithmetic("^", Name("x"), Number(2)), Number(9))),
        ("x<-3", stl.Predicate("<", Name("x"), Number(-3))),
        ("a\n  and b", stl.And(A, B)),
    ],
)
def test_precedence_and_spellings(text: str, tree: object) -> None:
    assert parse(text) == tree


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("-2^2", -4.0),
        ("(-2)^2", 4.0),
        ("2^3^2", 512.0),
        ("2^-1", 0.5),
        ("8 - 4 - 2", 2.0),
        ("8 / 4 / 2", 1.0),
        ("1 + 2 * 3", 7.0),
        ("--3", 3.0),
        ("2 * -3", -6.0),
        (".5 + 2. + 1e-1", 2.6),
        ("max(1, min(5, 4), 2)", 4.0),
        ("abs(-3) + sqrt(4) + exp(0) + log(1) + sin(0) + cos(0)", 7.0),
    ],
)
def test_arithmetic(text: str, value: float) -> None:
    formula = parse(f"{text} <= x")
    assert isinstance(formula, stl.Predicate)
    assert float(formula.left.evaluate({})) == pytest.approx(value)


@pytest.mark.parametrize(
    ("text", "window"),
    [
        ("[0,500ms]", stl.Window(0, 0.5)),
        ("[100 ms, 2 s]", stl.Window(0.1, 2)),
        ("[0.5min,1h]", stl.Window(30, 3600)),
        ("[0.29min,17.4s]", stl.Window(17.4, 17.4)),
        ("[1.3333333s,0.0222222min]", stl.Window(1.3333333, 1.3333333)),
        ("[0.0222223min,1.3333333s]", stl.Window(1.3333333, 1.3333333)),
        ("[0.2s,0.00333333333333334min]", stl.Window(0.2, 0.2)),
        ("[1h,3600.01s]", stl.Window(3600, 3600.01)),
        ("[0,250us]", stl.Window(0, 0.00025)),
        ("[1e1, 2E1]", stl.Window(10, 20)),
    ],
)
def test_windows_in_units(text: str, window: stl.Window) -> None:
    assert parse(f"G{text} b") == stl.Always(B, window)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("der(x)", "der(x)"),
        ("der( a.x , 2 )", "der(a.x,2)"),
        ("der(der(x))", "der(der(x))"),
        ("plant.der( x )", "plant.der(x)"),
        ("a[1].b.der(c.x,2)", "a[1].b.der(c.x,2)"),
        ("a.b[1].c", "a.b[1].c"),
        ("x[1, 2]", "x[1,2]"),
        ("'front left'.v", "'front left'.v"),
        ("car.'a, b'[1]", "car.'a, b'[1]"),
        ('"wheel speed"', "wheel speed"),
        ('"G"', "G"),
        ("G.x", "G.x"),
        ("G1.x", "G1.x"),
        ("ord.x", "ord.x"),
        ("note.x", "note.x"),
        ("F1", "F1"),
        ("max", "max"),
        ("ms", "ms"),
        ("_x$1", "_x$1"),
        (r'"say \"hi\" \\"', r'say "hi" \ '.strip()),
        ("müde", "müde"),
        ("$internal", "$internal"),
    ],
)
def test_names_as_models_have_them(text: str, name: str) -> None:
    formula = parse(f"{text} <= 3")
    assert formula.signals == (name,)
    assert parse(str(formula)) == formula


def test_a_signal_alone_is_a_boolean_one() -> None:
    formula = parse("b")
    assert isinstance(formula, stl.Flag)
    assert formula == B and str(formula) == "b"
    compared = parse("b >= 0.5")
    assert not isinstance(compared, stl.Flag) and str(compared) == "b >= 0.5"


@pytest.mark.parametrize(
    "text", ["G[0,5] not b", "b and not c or X b", "G b -> F[0,1] (b <-> c)", "b U[0,2] c"]
)
def test_a_boolean_signal_is_written_as_the_user_wrote_it(text: str) -> None:
    assert str(parse(text)) == text
    assert parse(str(parse(text))) == parse(text)


@pytest.mark.parametrize("block", range(4))
def test_what_is_printed_parses_to_the_same_tree(block: int) -> None:
    for seed in range(block * 500, (block + 1) * 500):
        formula = random_formula(random.Random(seed), 5)
        assert parse(str(formula)) == formula, seed


MISTAKES = [
    ("", 1, "empty"),
    ("x <= 3 y <= 3", 8, "join two formulas"),
    ("G[0,2] (x <= 3) (y <= 100)", 17, "join two formulas"),
    ("once[0,2] (x <= 3)", 11, "(F[2,2] a -> F[0,2] b)"),
    ("G (a -> once b)", 14, "not (not b U a)"),
    ("historically (x <= 3)", 14, "write G (a -> historically[0,2] b) as G[0,18] (F[2,2] a -> G[0,2] b)"),
    ("G[0,1] (x <= P", 15, "it closes the '(' at position 8"),
    ("G (a -> b S c)", 11, "no operators on the past"),
    ("a W b", 3, "not (not b U not a)"),
    ("a R b", 3, "(b U (a and b)) or G b"),
    ("x <= 5% * y", 7, "0.05*x"),
    ("G (x == 3 ==> y <= 3)", 13, "implication is ->"),
    ("x <= 3 --> y <= 3", 9, "implication is ->"),
    ("x <= 3 # slow", 8, "no comments"),
    ("x <= 3 // slow", 9, "no comments"),
    ("// slow\nx <= 3", 1, "no comments"),
    ("x <= 3 ? and y <= 3", 8, "no meaning"),
    ("always[2,0] x <= 3", 7, "[0,2]"),
    ("G[0,5) x <= 3", 6, "closed windows"),
    ("G(0,5) x <= 3", 2, "closed windows"),
    ("G(0,5 s] x <= 3", 2, "closed windows"),
    ("G[0,5 parsec] x <= 3", 7, "us, ms, s, min, h"),
    ("G[1,5ms] b", 2, "[1ms,5ms]"),
    ("G[-1,2] b", 3, "forward"),
    ("G[0,inf] b", 5, "stop time"),
    ("G[0] b", 4, "[a,b]"),
    ("G[0:5] b", 4, "with a comma: [a,b]"),
    ("G[0; 5] b", 4, "with a comma: [a,b]"),
    ("b and alw_[1.5 s : 2 s] (x <= 3)", 18, "with a comma: [a,b]"),
    ("b and x[2:3] <= 3", 10, "no meaning"),
    ("G[0,1e400] b", 5, "omit the window"),
    ("G[0,1e308] b", 5, "omit the window"),  # finite, but not in samples
    ("G[0,5]", 7, "ends too early"),
    ("(x <= 3", 8, "position 1"),
    ("x <= 3)", 7, "one ')' too many"),
    ("G <= 3", 3, '"G"'),
    ("x + U <= 3", 5, '"U"'),
    ("x = 3", 3, "=="),
    ("x ** 2 <= 3", 4, "x^y"),
    ("x <= 3 AND y <= 3", 8, "and"),
    ("x ≤ 3", 3, "<="),
    ("x > −3", 5, "write -"),
    ("(x > 1,5)", 7, "a point"),
    ("1,5 < x", 1, "a point"),
    ("G (1,5 < x)", 5, "a point"),
    ("G[0,2,5] b", 6, "a point"),
    ("x <= 5, y >= 3", 7, "join two"),
    ("G[0,5, 9] b", 6, "[a,b]"),
    ("x - 1", 1, "x - 1 >= 0"),
    ("3", 1, "compare it"),
    ("true", 1, "compare a signal"),
    ("x == true", 6, "not b"),
    ("x => 3", 6, ">="),
    ("x <= 5 ms", 8, "own unit"),
    ("pow(x,2) <= 3", 1, "x^y"),
    ("ln(x) <= 3", 1, "log"),
    ("tan(x) <= 3", 1, "sin"),
    ("x[1.5] <= 3", 2, "integers"),
    ("(x <= 3) + 1 <= 2", 1, "join formulas"),
    ("x + not b <= 3", 5, "parenthesis missing"),
    ("x <= G[0,5] y", 6, "parenthesis missing"),
    ("abs(x, y) <= 3", 1, "one expression"),
    ("min(x) <= 3", 1, "two or more"),
    ("a and", 6, "missing"),
    ("G (|x| <= 3)", 4, "abs(x)"),
    ("G (x <= 3 mph)", 11, "without units"),
    ("()", 2, "nothing between"),
    ("[0,5] x", 1, "directly after G"),
    ("1e999 <= x", 1, "1.8e308"),
    ("x <= 'a", 6, "second one"),
    ("x implies y", 3, "->"),
    ("x <> y", 4, "!="),
    ("x / / 3 <= 1", 5, "missing"),
    ("(x <= 3) --> (b)", 1, "implication is ->"),
    ("(x <= 3) ==> (b)", 1, "implication is ->"),
    ("x ⇒ y", 3, "->"),
    ("x >= 0 and <= 3", 12, "x >= 0 and x <= 3"),
    ("x == 1 or 2", 11, "x == 2"),
    ("x ~= y", 3, "!="),
    ("x <= +5", 6, "plus"),
    ("x(t) <= 3", 1, "without (t): x"),
    ("max(x) <= 3", 1, "G (x <= 3)"),
    ("rising(a) -> b", 1, "not a and X a"),
    ("if a then b", 4, "a -> b"),
    ("x <= prev(x)", 6, "let the model compute it"),
    ("ddt(x) <= 1", 1, "der(x)"),
    ("g[0,1] (x <= 3)", 8, "write G"),
    ("a and b u[0,1] c", 9, "write U"),
    ("g[0.5,1] x <= 3", 2, "write G"),
    ("globally[0,20] (x <= 3)", 16, "write G"),
    ("Always[0,20] (x <= 3)", 14, "lower case: always"),
    ("alw_[0,20] (x <= 3)", 12, "write G or always"),
    ("G_[0,20] (x <= 3)", 10, "write G"),
    ("FINALLY x <= 3", 9, "write F"),
    ("[] (x <= 3)", 1, "[] is written G"),
    ("a -> <>[0,3] (x <= 3)", 6, "<> is written F"),
    ("a <= b\nand c <== d", 16, "=="),
    ("x # 1", 3, "quotes"),
    ('plant."wheel speed" <= 3', 6, "whole name in one pair"),
    ('"big plant".x <= 3', 12, "whole name in one pair"),
    ("(" * 500 + "b" + ")" * 500, 101, "split"),
    ("b" + " and b" * 300, 1, "split"),
]


@pytest.mark.parametrize(("text", "position", "hint"), MISTAKES, ids=[m[0][:30] for m in MISTAKES])
def test_what_is_not_one_formula_is_an_error_that_points_there(text: str, position: int, hint: str) -> None:
    with pytest.raises(FormulaError) as caught:
        parse(text)
    first, line, caret, *_ = str(caught.value).split("\n")
    assert f"(position {position})" in first
    assert hint in str(caught.value)
    start = text.rfind("\n", 0, position - 1) + 1
    shown, whole = line[2:], text[start:].split("\n")[0]
    column = position - 1 - start
    assert shown in whole and len(shown) >= min(len(whole), 150), "long lines are cut around the position"
    assert f"{line} "[caret.index("^")] == f"{whole} "[column]
    assert caret == " " * (2 + column) + "^" or len(whole) > len(shown)


PIECES = "G F U X [0,1] [0, 1 not and or -> <-> ( ) x y b 3 -2 'q' ms , <= < == + - * / ^ abs( min("

PHRASES = st.lists(st.sampled_from(PIECES.split()), max_size=12).map(" ".join)


@given(st.one_of(PHRASES, PHRASES, PHRASES, st.text(max_size=20)))
@settings(max_examples=1500)
def test_any_text_is_a_formula_that_reads_back_or_an_error_with_a_hint(text: str) -> None:
    try:
        formula = parse(text)
    except FormulaError as error:
        assert "hint: " in str(error)
    else:
        assert parse(str(formula)) == formula


@given(st.text(st.characters(exclude_characters="\n", codec="utf-8"), min_size=1, max_size=20))
def test_any_name_is_written_so_that_it_reads_back(name: str) -> None:
    assert parse(f"{name_text(name)} <= 3").signals == (name,)


def test_the_deepest_formulas_print_hash_and_travel() -> None:
    for text in ("b" + " and b" * 97, "not " * 97 + "b", "b -> " * 97 + "b", "x" + " + x" * 97 + " <= 1"):
        formula = parse(text)
        again = pickle.loads(pickle.dumps(formula))
        assert again == formula == parse(text)
        assert hash(again) == hash(formula)
