import pytest

from falsifier.context import sources
from falsifier.context.excerpts import Readable, of_text

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
    return {form.name: form.text() for form in readable.forms}


def test_sources_have_shorter_and_shorter_forms() -> None:
    readable = of_text(MODEL, "a.mo", ["y"], ["y", "u"])
    assert texts(readable) == {
        "whole": MODEL.replace(" annotation(Placement(extent = {{0, 0}, {1, 1}}))", ""),
        "parameters and comparisons": "p = 3\nu > p (p = 3)  [a.mo:6]",
        "comparisons": "u > p (p = 3)  [a.mo:6]",
        "lines with the requirement's signals": "Real y;\ny = if u > p then 1 else 0;",
        "size only": "1 class",
    }
    assert [t.text for t in readable.found] == ["u > p (p = 3)"]


def test_a_source_inside_an_fmu_is_told_only_if_it_sets_a_signal() -> None:
    source = "void f(M *m) { if (m->a > 3) m->b = 1; }"
    assert texts(of_text(source, "a.c", ["b"], ["b"], is_named=False))["comparisons"] == "m->a > 3  [a.c:1]"
    assert [f.name for f in of_text(source, "a.c", ["o"], ["o"], is_named=False).forms] == ["size only"]
    assert "whole" in texts(of_text(source, "a.c", ["o"], ["o"]))


def test_a_source_that_is_too_long_is_text(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "_MAX_CHARACTERS", 10)
    assert "comparisons" not in texts(of_text("void f(void) { speed = u > 3; }", "a.c", ["speed"], ["speed"]))


def test_pages_lose_their_tags() -> None:
    told = texts(of_text(PAGE, "a.html", ["speed"], ["speed"]))
    assert "The value of speed stays < 3." in told["whole"]
    assert "x()" not in told["whole"]
    assert told["paragraphs that name a signal"] == "The value of speed stays < 3."


def test_documents_keep_headings_and_paragraphs_that_name_a_signal() -> None:
    text = "# One\n\nNothing.\n\n## Two\n\nThe plant.speed is\nlimited.\n"
    told = texts(of_text(text, "a.md", ["plant.speed"], ["plant.speed"]))
    assert (
        told["headings, and paragraphs that name a signal"] == "# One\n## Two\n\nThe plant.speed is limited."
    )
    assert told["headings"] == "# One\n## Two"
    assert told["size only"] == "8 lines"


def test_json_is_told_by_its_keys_if_it_is_long() -> None:
    told = texts(of_text('{"a": [1, 2], "b": 3}', "a.json", [], []))
    assert told["keys"] == "a, b"
    assert "size only" in texts(of_text("[1", "a.json", [], []))


def test_json_of_a_single_value_is_told_as_it_is() -> None:
    assert texts(of_text("3.5", "a.json", [], []))["whole"] == "3.5"
    assert texts(of_text("null", "a.json", [], []))["whole"] == "null"


def test_pages_whose_head_is_not_closed_keep_their_text() -> None:
    page = "<html><head><title>no</title><body>The limit is 5 R&D"
    assert texts(of_text(page, "a.html", [], []))["whole"] == "The limit is 5 R&D"
