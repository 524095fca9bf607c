"""The page's structure, read by a parser; test_browser.py looks at it in a browser."""

import json
import re
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from falsifier.core.candidate import Candidate
from falsifier.engines import make_engine
from falsifier.evaluation.evaluate import Evaluation
from falsifier.record.run import falsify
from falsifier.views.report import html_report
from falsifier.views.report.plots import scripts
from tests.problems import easy

VOID = {"meta", "link", "br", "hr"}
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


def plots_of(element: Element) -> list[dict[str, Any]]:
    """What the groups of plots within an element show."""
    return [json.loads(group.all("script")[0].content) for group in element.all("div", "plots")]


def code(page: Element) -> list[str]:
    """Scripts that a browser runs."""
    return [e.content for e in page.all("script") if e.attributes.get("type") != "application/json"]


def test_it_needs_nothing_from_elsewhere_and_runs_only_the_plots(page: Element) -> None:
    (policy,) = (
        e.attributes["content"] or ""
        for e in page.all("meta")
        if e.attributes.get("http-equiv") == "Content-Security-Policy"
    )
    assert code(page) == scripts()
    hashes = [b64encode(sha256(text.encode()).digest()).decode() for text in code(page)]
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert re.findall("'sha256-([^']*)'", policy) == hashes
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
    falsified, not_falsified = (row.content for row in page.all("tbody")[0].all("tr"))
    assert re.match(
        r"HARDfalsified in 4 of 4 runs, the quickest after \d+ simulations?: x <= 0\.6 was violated from ",
        falsified,
    )
    assert re.match(r"NEVERnot falsified in 80 simulations: 1\S* away from a violation", not_falsified)
    rows = page.all("tbody")[1].all("tr")
    assert [row.content[:4] for row in rows] == ["HARD", "HARD", "NEVE", "NEVE"]
    hard, never = page.all("section")[2:4]
    counterexamples = [d for d in hard.all("details") if d.attributes.get("class") != "numbers"]
    assert len(counterexamples) == 4
    for details in counterexamples:
        (group,) = plots_of(details)
        assert len(details.all("div", "plot")) == len(group["plots"]) == 2  # the output x and the input u
        output, input_ = group["plots"]
        assert [line["style"] for line in output["lines"]] == ["bound", "output"]
        assert [dots["style"] for dots in output["dots"]] == ["critical"]
        assert len(output["windows"]) == 1
        assert group["mark"] is not None
        assert len(input_["dots"][0]["x"]) == 4
        times = [row.all("th")[0].content for row in details.all("tbody")[0].all("tr")]
        assert sum("marked" in time for time in times) == 1
        assert "falsifier replay" in details.content
        assert "falsifier run python:tests.problems:hard" in details.content
    assert "Closest to a violation" in [e.content for e in never.all("h3")]
    assert sum(d.attributes.get("class") != "numbers" for d in never.all("details")) == 1


def test_histories_show_every_simulation_and_the_best_so_far(page: Element) -> None:
    hard, never = page.all("section")[2:4]
    by_label = dict(
        zip([e.attributes["aria-label"] for e in hard.all("div", "history")], plots_of(hard), strict=False)
    )
    (chart,) = by_label["Robustness over simulations, uniform"]["plots"]
    assert [line["style"] for line in chart["lines"]] == ["best", "best"]
    assert [dots["style"] for dots in chart["dots"]] == ["dots", "dots", "critical", "critical"]
    (never_chart,) = plots_of(never)[0]["plots"]
    assert [len(dots["x"]) for dots in never_chart["dots"]] == [20, 20]
    rows = never.all("details", "numbers")[0].all("tbody")[0].all("tr")
    assert [row.all("td")[0].content for row in rows] == ["20", "20"]
    assert [row.all("td")[2].content for row in rows] == ["–", "–"]


def test_it_can_be_used_without_a_mouse_and_read_aloud(page: Element) -> None:
    assert page.all("html")[0].attributes["lang"] == "en"
    assert len(page.all("main")) == len(page.all("h1")) == 1
    assert page.all("body")[0].children[0].content == "Skip to the results"
    for group in page.all("div", "plots"):
        assert group.all("details", "numbers")[0].all("table")
        assert "open" in group.all("details", "numbers")[0].attributes
        for chart in group.all("div", "plot"):
            assert chart.attributes["role"] == "img"
            assert chart.attributes["aria-label"]
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
    assert code(root) == scripts()
    assert not root.all("img")
    (quote,) = root.all("blockquote")
    assert quote.content == EVIL


def test_the_environment_is_told(page: Element) -> None:
    text = page.all("section")[-1].content
    assert "numpy" in text
    assert "Python" in text
