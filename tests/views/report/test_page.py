"""The page's structure, read by a parser; test_browser.py looks at it in a browser."""

import re
from base64 import b64decode
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

from falsifier.campaigns.analysis import load, load_run
from falsifier.core.candidate import Candidate
from falsifier.record.run import falsify
from falsifier.testing import START, lag_problem
from falsifier.views.report import html_report
from tests.problems import easy, hard
from tests.searches import Wrapped

VOID = {"meta", "link", "br", "hr", "img"}
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
        if tag not in VOID:
            self.open.append(element)

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


class Talker(Wrapped):
    """Proposes what corners propose, and says something nasty."""

    def ask(self, n: int = 1) -> list[Candidate]:
        return [replace(c, rationale=EVIL) for c in self.inner.ask(n)]


@pytest.fixture(scope="module")
def talked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run whose engine's rationale is an attack."""
    directory = tmp_path_factory.mktemp("talked")
    falsify(easy(), Talker(easy(), inner="corners"), budget=5, directory=directory)
    return directory


@pytest.fixture(scope="module")
def page(campaign: Path) -> Element:
    return parse(html_report(campaign))


def test_it_needs_nothing_from_elsewhere_and_runs_no_script(page: Element) -> None:
    (policy,) = (
        e.attributes["content"] or ""
        for e in page.all("meta")
        if e.attributes.get("http-equiv") == "Content-Security-Policy"
    )
    assert policy == "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    assert not [tag for tag in ("script", "link", "iframe") if page.all(tag)]
    for element in page.walk():
        for name, value in element.attributes.items():
            assert not name.startswith("on"), f"{element.tag} has {name}"
            if name in ("href", "src", "xlink:href"):
                assert (value or "").startswith(("#", "data:image/svg+xml;base64,")), value
    assert not re.search(r"url\(|@import", page.all("style")[0].content)


def test_links_lead_somewhere_and_ids_are_unique(page: Element) -> None:
    ids = [e.attributes["id"] for e in page.walk() if "id" in e.attributes]
    assert len(ids) == len(set(ids))
    for link in page.all("a"):
        assert (link.attributes["href"] or "")[1:] in ids


def test_each_requirement_has_a_card_with_its_verdict_first(page: Element) -> None:
    assert "1 of 2 requirements violated, 8 runs" in page.all("header")[0].content
    violated, held = page.all("article")
    badges = [card.all("span", "badge")[0].content for card in (violated, held)]
    assert badges == ["violated", "no violation found"]
    assert "violated" in (violated.attributes["class"] or "").split()
    assert re.search(r"found in 4 of 4 runs, the quickest after \d+ simulation", violated.content)
    limits = violated.all("div", "limits")[0].content
    assert "requiredx <= 0.6" in limits and re.search(r"reachedx = 0\.[67]\d* m", limits)
    assert re.search(r"violatedfrom [\d.]+ s to [\d.]+ s", limits)
    assert "no violation found in 80 simulations" in held.content
    assert "away from a violation" in held.all("div", "limits")[0].content
    assert "confirmed" not in [e.content for e in held.all("dt")]


def test_the_order_is_verdict_picture_inputs_confirmation_and_the_rest_is_folded(page: Element) -> None:
    text = page.all("article")[0].content
    order = ["required", "The counterexample", "Inputs to enter", "confirmed", "Formula, 4 runs"]
    places = [text.index(part) for part in order]
    assert places == sorted(places)
    (more,) = page.all("article")[0].all("details", "more")
    assert "open" not in more.attributes
    for folded in ("uniform, seed 0", "rationale", "falsifier replay", "falsifier run python:tests"):
        assert folded in more.content
    versions = page.all("details")[-1].content
    assert "numpy" in versions and "Python" in versions
    assert len(more.all("img")) == 2 + 1 + 2, "a history for each method, shares, two more counterexamples"


def test_inputs_are_a_table_of_their_control_points(tmp_path: Path) -> None:
    problem = lag_problem(parameters=[START])
    falsify(problem, "corners", budget=30, directory=tmp_path)
    run, card = load_run(tmp_path), parse(html_report(tmp_path)).all("article")[0]
    assert run.falsified
    table = card.all("table", "numbers")[0]
    assert "u [V]" in table.all("thead")[0].content
    assert "x0 =" in [e.content for e in card.all("dt")]
    assert "values then" in [e.content for e in card.all("dt")]
    assert re.search(r"x = [\d.]+ m, u = [-\d.]+ V", card.content), "values have units"


def test_what_was_tried_and_what_was_not_tested_is_told_where_nothing_was_found(page: Element) -> None:
    violated, held = page.all("article")
    assert "What was tried" in [e.content for e in held.all("h3")]
    assert "parts" in held.content and "u [V]" in [e.content for e in held.all("dt")]
    assert "What this does not show" in [e.content for e in held.all("h3")]
    assert "What was tried" not in violated.content


def test_statistics_are_for_campaigns_only(page: Element, campaign: Path) -> None:
    (statistics,) = page.all("section", "statistics")
    rows = statistics.all("tbody")[0].all("tr")
    assert [row.content[:4] for row in rows] == ["HARD", "HARD", "NEVE", "NEVE"]
    single = parse(html_report(load(campaign)[0].directory))
    assert not single.all("section", "statistics")
    assert "Wilson" not in single.content


def test_runs_are_compared_side_by_side(tmp_path: Path) -> None:
    falsify(hard(), "corners", budget=10, directory=tmp_path / "before")
    stronger = replace(hard(), requirement=lag_problem("G[0,10] (x <= 2)", name="HARD").requirement)
    falsify(stronger, "corners", budget=10, directory=tmp_path / "after")
    falsify(easy(), "corners", budget=10, directory=tmp_path / "other")
    root = parse(html_report(tmp_path / "before", tmp_path / "after", tmp_path / "other"))
    first, second = root.all("section", "sides")
    assert [card.all("h2")[0].content for card in first.all("article")] == [
        "HARD: before violated",
        "HARD: after no violation found",
        "HARD: other",
    ]
    assert "Not searched here." in second.all("article")[0].content
    assert root.all("h1")[0].content == "before and after and other"
    differing = root.all("main")[0].children[1]
    assert "What differs" in differing.content and "seed" not in differing.content
    assert "formula of HARDG[0,10] (x <= 0.6)G[0,10] (x <= 2)" in differing.content


def test_pictures_are_images_with_a_text_in_their_place(page: Element) -> None:
    for image in page.all("img"):
        assert image.attributes["alt"]
        content = b64decode((image.attributes["src"] or "").partition("base64,")[2])
        assert ElementTree.fromstring(content).tag == "{http://www.w3.org/2000/svg}svg"


def test_it_can_be_used_without_a_mouse_and_read_aloud(page: Element) -> None:
    assert page.all("html")[0].attributes["lang"] == "en"
    assert len(page.all("main")) == len(page.all("h1")) == 1
    assert page.all("body")[0].children[0].content == "Skip to the results"
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
    assert EVIL in [e.content for e in root.all("dd")]
