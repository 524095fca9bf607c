import pytest

from falsifier.context import sources
from falsifier.context.excerpts import Readable, of_source, of_text, source_of

PAGE = """<html><head><title>no</title><style>p {}</style></head><body><h1>1 Limits</h1>
<p>The value of <b>speed</b> stays &lt; 3.</p><script>x()</script><p>Other.</p></body></html>"""
MODEL = """model M
 parameter Real p = 3;
 input Real u annotation(Placement(extent = {{0, 0}, {1, 1}}));
 Real y;
equation
 y = if u > p then 1 else 0;
end M;"""


def texts(readable: Readable) -> dict[str, str]:
    return dict(readable.forms)


def read(text: str, shown: str, seed: str, *, is_named: bool = True) -> Readable:
    source = source_of(text, shown)
    assert source is not None
    return of_source(source, [source], [seed], is_named=is_named)


def test_sources_have_shorter_and_shorter_forms() -> None:
    readable = read(MODEL, "a.mo", "y")
    assert texts(readable) == {
        "whole": MODEL.replace(" annotation(Placement(extent = {{0, 0}, {1, 1}}))", ""),
        "parameters and comparisons": "p = 3\nu > p (p = 3)  [a.mo:6]",
        "lines with the requirement's signals": "Real y;\ny = if u > p then 1 else 0;",
        "size only": "7 lines",
    }
    assert [t.text for t in readable.found] == ["u > p (p = 3)"]


def test_a_source_inside_an_fmu_is_told_only_if_it_sets_a_signal() -> None:
    source = "void f(M *m) { if (m->a > 3) m->b = 1; }"
    assert "m->a > 3  [a.c:1]" in texts(read(source, "a.c", "b", is_named=False)).values()
    assert list(texts(read(source, "a.c", "a", is_named=False))) == ["size only"]
    assert "whole" in texts(read(source, "a.c", "o"))


def test_a_source_that_is_too_long_is_text(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "_MAX_CHARACTERS", 10)
    assert source_of("void f(void) { speed = u > 3; }", "a.c") is None


def test_pages_lose_their_tags() -> None:
    told = texts(of_text(PAGE, "a.html", ["speed"]))
    assert "The value of speed stays < 3." in told["whole"]
    assert "x()" not in told["whole"]
    assert told["paragraphs that name a signal"] == "The value of speed stays < 3."


def test_documents_keep_headings_and_paragraphs_that_name_a_signal() -> None:
    text = "# One\n\nNothing.\n\n## Two\n\nThe plant.speed is\nlimited.\n"
    told = texts(of_text(text, "a.md", ["plant.speed"]))
    assert (
        told["headings, and paragraphs that name a signal"] == "# One\n## Two\n\nThe plant.speed is limited."
    )
    assert told["headings"] == "# One\n## Two"
    assert told["size only"] == "8 lines"
