from falsifier.context.statements import Branch, Statement, assignments, heads, rendered, simple, sliced


def sets(name: str, *uses: str, equation: bool = False) -> Statement:
    return Statement(f"{name} = {' + '.join(uses)};", 1, frozenset({name}), frozenset(uses), equation)


A, B, C = sets("a", "b"), sets("b", "p"), sets("c", "a")
MARK = Statement("break;", 1, is_mark=True)
WHEN = Statement(
    "end when;",
    3,
    branches=(
        Branch("when m then", frozenset({"m"}), (A, C, MARK)),
        Branch("elsewhen n then", frozenset({"n"}), (sets("d"),)),
    ),
)


def test_a_slice_follows_uses_conditions_and_declared_values() -> None:
    found = sliced([WHEN, B], {"p": ["q"]}, ["a"])
    assert found.names == {"a", "b", "m", "n", "p", "q"}
    assert found.kept == {A, B}


def test_an_unknown_that_nothing_sets_is_found_in_equations() -> None:
    equation = sets("u", "r", "i", equation=True)
    assert sliced([equation], {}, ["i"], unknowns=["i"]).names == {"u", "r", "i"}
    assert sliced([equation], {}, ["i"]).names == {"i"}  # an input or a parameter
    assert sliced([sets("u", "i")], {}, ["i"], unknowns=["i"]).names == {"i"}


def test_conditions_are_kept_around_what_is_kept() -> None:
    lines = list(rendered([WHEN, B], {A}))
    assert lines == ["when m then", "  a = b;", "elsewhen n then", "  ...", "end when;"]
    assert list(heads([WHEN, B], {A})) == [("when m then", 3), ("elsewhen n then", 3)]
    assert list(heads([WHEN, B], {B})) == []
    assert list(simple([WHEN, B])) == [A, C, MARK, sets("d"), B]


def test_marks_are_kept_with_their_surroundings() -> None:
    inner = Statement("}", 2, branches=(Branch("switch (m) {", frozenset(), (A, MARK)),))
    assert "    break;" in list(
        rendered([Statement("}", 1, branches=(Branch("if", frozenset(), (inner,)),))], {A})
    )


def test_what_a_variable_equals_has_one_statement_under_no_condition() -> None:
    def plain(text: str, sets: str, *uses: str) -> Statement:
        return Statement(text, 1, frozenset({sets}), frozenset(uses))

    branch = Branch("if c then", frozenset("c"), (plain("e = 3;", "e"),))
    equal, used = assignments(
        [
            plain("a = 2 * b;", "a", "b"),
            plain("double d = a - 1;", "d", "a"),
            plain("m->f := d;", "f", "d"),
            plain("g = 1;", "g"),
            plain("g = b;", "g", "b"),
            plain("der(x) = u;", "x", "u"),
            Statement("end if;", 1, branches=(branch,)),
        ]
    )
    assert equal == {"a": "2 * b", "d": "a - 1", "f": "d"}
    assert (used["g"], used["x"]) == (frozenset("b"), frozenset("u"))
