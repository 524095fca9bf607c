"""The page's structure, read by a parser; test_browser.py looks at it in a browser."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest

from falsifier.core.candidate import Candidate
from falsifier.engines import make_engine
from falsifier.evaluation.evaluate import Evaluation
from falsifier.search.run import falsify
from falsifier.views.report import html_report
from tests.problems import easy

VOID = {"meta", "link", "br", "hr", "circle", "line", "path", "rect"}
EVIL = "<script>alert(1)</script> & \"quotes\" <img src=x onerror='alert(2)'>"


@dataclass
class Element:
    tag: str
    attributes: dict[str, str | None]
    children: list["Element"] = field(default_factory=list)
    text: str = ""

    def walk(self) -> Iterator["Element"]:
        yield self
        for child in self.children:
            yield from child.walk()

    def all(self, tag: str, class_: str | None = None) -> list["Element"]:
        return [
            e
            for e in self.walk()
            if e.tag == tag and (class_ is None or class_ in (e.attributes.get("class") or "").split())
        ]

    @property
    def content(self) -> str:
        return self.text + "".join(child.content for child in self.children)


class Parser(HTMLParser):
    """Builds the tree and insists that every element is closed where it was opened."""

    def __init__(self) -> None:
        super().__init__()
        self.root = Element("root", {})
        self.open = [self.root]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = Element(tag, dict(attrs))
        self.open[-1].children.append(element)
        if tag not in VOID or (tag in ("circle", "line", "path", "rect") and not self._closed()):
            self.open.append(element)

    def _closed(self) -> bool:
        return (self.get_starttag_text() or "").endswith("/>")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open[-1].children.append(Element(tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open[-1].tag == tag, f"</{tag}> closes <{self.open[-1].tag}>"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        self.open[-1].text += data


def parse(page: str) -> Element:
    parser = Parser()
    parser.feed(page)
    parser.close()
    assert len(parser.open) == 1, f"left open: {[e.tag for e in parser.open[1:]]}"
    return parser.root


class Talker:
    """Proposes what corners propose, and says something nasty."""

    name = "talker"

    def __init__(self) -> None:
        self.inner = make_engine("corners", easy(), seed=0)

    def ask(self, n: int = 1) -> list[Candidate]:
        return [replace(c, rationale=EVIL) for c in self.inner.ask(n)]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self.inner.tell(evaluations)


@pytest.fixture(scope="module")
def talked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run whose engine's rationale is an attack."""
    directory = tmp_path_factory.mktemp("talked")
    falsify(easy(), Talker(), budget=5, directory=directory)
    return directory


@pytest.fixture(scope="module")
def page(campaign: Path) -> Element:
    return parse(html_report(campaign))


def test_it_needs_nothing_from_elsewhere_and_runs_nothing(campaign: Path, page: Element) -> None:
    assert not page.all("script")
    assert not page.all("link")
    assert not page.all("iframe")
    for element in page.walk():
        for name, value in element.attributes.items():
            assert not name.startswith("on"), f"{element.tag} has {name}"
            if name in ("href", "src", "xlink:href"):
                assert (value or "").startswith("#"), value
    assert not re.search(r"url\(|@import", page.all("style")[0].content)


def test_links_lead_somewhere_and_ids_are_unique(page: Element) -> None:
    ids = [e.attributes["id"] for e in page.walk() if "id" in e.attributes]
    assert len(ids) == len(set(ids))
    for link in page.all("a"):
        assert (link.attributes["href"] or "")[1:] in ids


def test_every_run_is_counted_and_every_counterexample_is_drawn(page: Element) -> None:
    assert "2 requirements, 8 runs, 4 falsified" in page.all("header")[0].content
    rows = page.all("tbody")[0].all("tr")
    assert [row.content[:4] for row in rows] == ["HARD", "HARD", "NEVE", "NEVE"]
    hard, never = page.all("section")[1:3]
    assert len(hard.all("details")) == 4
    for details in hard.all("details"):
        assert len(details.all("svg")) == 2  # the output x and the input u
        output, input_ = details.all("svg")
        assert output.all("path", "bound") and output.all("rect", "window")
        assert len(output.all("circle", "critical")) == len(output.all("line", "critical-time")) == 1
        assert len(input_.all("circle", "point")) == 4
        assert "falsifier replay" in details.content
        assert "falsifier run python:tests.problems:hard" in details.content
    assert never.all("h3")[0].content == "Closest to a violation"
    assert len(never.all("details")) == 1


def test_histories_show_every_simulation_and_the_best_so_far(page: Element) -> None:
    chart = next(
        s for s in page.all("svg") if s.attributes["aria-label"] == "Robustness over simulations, uniform"
    )
    never = page.all("section")[2].all("svg")[0]
    assert len(chart.all("path", "best")) == 2
    assert [p.attributes["d"].count("h0") for p in never.all("path", "dots")] == [20, 20]  # type: ignore[union-attr]
    assert len(chart.all("circle", "critical")) == 2
    assert not never.all("circle", "critical")


def test_it_can_be_used_without_a_mouse_and_read_aloud(page: Element) -> None:
    assert page.all("html")[0].attributes["lang"] == "en"
    assert len(page.all("main")) == len(page.all("h1")) == 1
    assert page.all("body")[0].children[0].content == "Skip to the results"
    for chart in page.all("svg"):
        assert chart.attributes["role"] == "img"
        assert chart.attributes["aria-label"] == chart.all("title")[0].content
    for region in page.all("div", "scroll"):
        assert region.attributes["tabindex"] == "0"
        assert region.attributes["aria-label"]
    headings = [int(e.tag[1]) for e in page.walk() if re.fullmatch(r"h[1-6]", e.tag)]
    assert all(b <= a + 1 for a, b in pairwise(headings))
    style = page.all("style")[0].content
    for needed in ("prefers-color-scheme: dark", "@media print", ":focus-visible", "details-content"):
        assert needed in style


def test_what_a_model_says_is_text(talked: Path) -> None:
    text = html_report(talked)
    root = parse(text)
    assert EVIL not in text
    assert not root.all("script")
    assert not root.all("img")
    (quote,) = root.all("blockquote")
    assert quote.content == EVIL


def test_the_environment_is_told(page: Element) -> None:
    text = page.all("section")[-1].content
    assert "numpy" in text
    assert "Python" in text
