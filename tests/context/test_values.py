from falsifier.context.values import Compared, Context, Named


def test_what_is_known_of_a_signal() -> None:
    context = Context(comparisons=(Compared(("u",), "u > 3", "a.mo:1"), Compared((), "x > 1", "a.mo:2")))
    assert context.of("u") == ("u > 3",)
    assert context.of("x") == ()


def test_nothing_named_is_false() -> None:
    assert not Named()
    assert Named(("a.md",))
    assert Named(fmu=True)


def test_a_checked_file_alone_is_not_overlooked() -> None:
    assert Named.of(["checked:a.md"])
    assert not Named.of(["none"])
