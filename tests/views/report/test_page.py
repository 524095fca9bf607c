"""The page's structure, read by a parser; test_browser.py looks at it in a browser."""

import re
from base64 import b64decode
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest

from falsifier.campaigns.analysis import load, load_run
from falsifier.core.candidate import Candidate
from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.core.signals import Signal
from falsifier.core.words import signal_text
from falsifier.record.run import falsify
from falsifier.testing import START, lag_problem
from falsifier.views.report import html_report
from falsifier.views.report.wording import input_table, parameter_facts
from tests.pages import content, every, parse
from tests.problems import easy, hard
from tests.searches import Wrapped

EVIL = "<script>alert(1)</script> & \"quotes\" <img src=x onerror='alert(2)'>"


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
        e.attrib["content"]
        for e in every(page, "meta")
        if e.attrib.get("http-equiv") == "Content-Security-Policy"
    )
    assert policy == "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    assert not [tag for tag in ("script", "link", "iframe") if every(page, tag)]
    for element in page.iter():
        for name, value in element.attrib.items():
            assert not name.startswith("on"), f"{element.tag} has {name}"
            if name in ("href", "src", "xlink:href"):
                assert value.startswith(("#", "data:image/svg+xml;base64,")), value
    assert not re.search(r"url\(|@import", content(every(page, "style")[0]))


def test_links_lead_somewhere_and_ids_are_unique(page: Element) -> None:
    ids = [e.attrib["id"] for e in page.iter() if "id" in e.attrib]
    assert len(ids) == len(set(ids))
    for link in every(page, "a"):
        assert link.attrib["href"][1:] in ids


def test_requirements_that_share_a_search_are_one_run(tmp_path: Path) -> None:
    falsify([hard(), lag_problem()], "uniform", budget=2, directory=tmp_path)
    assert " of 2 requirements violated, 1 run, " in html_report(tmp_path)


def test_each_requirement_has_a_card_with_its_verdict_first(page: Element) -> None:
    assert "1 of 2 requirements violated, 8 runs" in content(every(page, "header")[0])
    violated, held = every(page, "article")
    badges = [content(every(card, "span", "badge")[0]) for card in (violated, held)]
    assert badges == ["violated", "no violation found"]
    assert "violated" in violated.attrib["class"].split()
    assert re.search(r"found in 4 of 4 runs, the quickest after \d+ simulation", content(violated))
    limits = content(every(violated, "div", "limits")[0])
    assert re.search(r"x <= 0.6 was violated from [\d.]+ to [\d.]+ s: x = 0\.[67]\d* m at ", limits)
    assert "no violation found in 80 simulations" in content(held)
    assert "holds with this margin" in content(every(held, "div", "limits")[0])
    assert "confirmed" not in [content(e) for e in every(held, "dt")]


def test_the_order_is_verdict_picture_inputs_confirmation_and_the_rest_is_folded(page: Element) -> None:
    text = content(every(page, "article")[0])
    order = ["what broke", "The counterexample", "Inputs to enter", "confirmed", "Formula, 4 runs"]
    places = [text.index(part) for part in order]
    assert places == sorted(places)
    (more,) = every(every(page, "article")[0], "details", "more")
    assert "open" not in more.attrib
    for folded in ("uniform, seed 0", "rationale", "falsifier replay", "falsifier run python:tests"):
        assert folded in content(more)
    versions = content(every(page, "details")[-1])
    assert "numpy" in versions and "Python" in versions
    assert len(every(more, "img")) == 2 + 1 + 2, "a history for each method, shares, two more counterexamples"


def test_inputs_are_a_table_of_their_control_points(tmp_path: Path) -> None:
    problem = lag_problem(parameters=[START])
    falsify(problem, "corners", budget=30, directory=tmp_path)
    run, card = load_run(tmp_path), every(parse(html_report(tmp_path)), "article")[0]
    assert run.falsified
    table = every(card, "table", "numbers")[0]
    assert "u [V]" in content(every(table, "thead")[0])
    assert "x0" in [content(e) for e in every(card, "dt")]
    assert "values then" in [content(e) for e in every(card, "dt")]
    assert re.search(r"x = [\d.]+ m, u = [-\d.]+ V", content(card)), "values have units"


def test_numbers_to_enter_are_not_rounded_to_six_digits() -> None:
    u = Signal((0.0, 43215.25), (2147483647.0, 1 / 3), "constant")
    narrow = ParameterRange("mass", 1e12, 1e12 + 1.0)
    manifest = SimpleNamespace(
        stop_time=43216.0, inputs=(InputRange("u", 0.0, 2147483647.0),), parameters=(narrow,)
    )
    candidate = Candidate({"u": u}, {"mass": 1e12 + 0.25, "k": 0.123456789012})
    shown = SimpleNamespace(candidate=candidate, units={}, run=SimpleNamespace(manifest=manifest))
    assert input_table(shown).rows == (("0", "2147483647"), ("43215.25", "0.3333333333"))  # type: ignore[arg-type]
    assert parameter_facts(shown) == [  # type: ignore[arg-type]
        ("mass", "1000000000000.25"),
        ("k", "0.123456789012"),
    ]
    assert signal_text(Signal((0.0,), (2147483647.0,))) == "constant 2147483647"


def test_what_was_tried_and_what_was_not_tested_is_told_where_nothing_was_found(page: Element) -> None:
    violated, held = every(page, "article")
    assert "What was tried" in [content(e) for e in every(held, "h3")]
    assert "parts" in content(held) and "u [V]" in [content(e) for e in every(held, "dt")]
    assert "What this does not show" in [content(e) for e in every(held, "h3")]
    assert "What was tried" not in content(violated)


def test_statistics_are_for_campaigns_only(page: Element, campaign: Path) -> None:
    (statistics,) = every(page, "section", "statistics")
    rows = every(every(statistics, "tbody")[0], "tr")
    assert [content(row)[:4] for row in rows] == ["HARD", "HARD", "NEVE", "NEVE"]
    single = parse(html_report(load(campaign)[0].directory))
    assert not every(single, "section", "statistics")
    assert "Wilson" not in content(single)


def test_runs_are_compared_side_by_side(tmp_path: Path) -> None:
    falsify(hard(), "corners", budget=10, directory=tmp_path / "before")
    stronger = replace(hard(), requirement=lag_problem("G[0,10] (x <= 2)", name="HARD").requirement)
    falsify(stronger, "corners", budget=10, directory=tmp_path / "after")
    falsify(easy(), "corners", budget=10, directory=tmp_path / "other")
    root = parse(html_report(tmp_path / "before", tmp_path / "after", tmp_path / "other"))
    first, second = every(root, "section", "sides")
    assert [content(every(card, "h2")[0]) for card in every(first, "article")] == [
        "HARD: before violated",
        "HARD: after no violation found",
        "HARD: other",
    ]
    assert "Not searched here." in content(every(second, "article")[0])
    assert content(every(root, "h1")[0]) == "before and after and other"
    differing = every(root, "main")[0][1]
    assert "What differs" in content(differing) and "seed" not in content(differing)
    assert "formula of HARDG[0,10] (x <= 0.6)G[0,10] (x <= 2)" in content(differing)


def test_pictures_are_images_with_a_text_in_their_place(page: Element) -> None:
    for image in every(page, "img"):
        assert image.attrib["alt"]
        picture = b64decode(image.attrib["src"].partition("base64,")[2])
        assert ElementTree.fromstring(picture).tag == "{http://www.w3.org/2000/svg}svg"


def test_it_can_be_used_without_a_mouse_and_read_aloud(page: Element) -> None:
    assert every(page, "html")[0].attrib["lang"] == "en"
    assert len(every(page, "main")) == len(every(page, "h1")) == 1
    assert content(every(page, "body")[0][0]) == "Skip to the results"
    for region in every(page, "div", "scroll"):
        assert region.attrib["tabindex"] == "0"
        assert region.attrib["aria-label"]
    headings = [int(e.tag[1]) for e in page.iter() if re.fullmatch(r"h[1-6]", e.tag)]
    assert all(b <= a + 1 for a, b in pairwise(headings))
    style = content(every(page, "style")[0])
    for needed in ("prefers-color-scheme: dark", "@media print", ":focus-visible", "details-content"):
        assert needed in style


def test_what_a_model_says_is_text(talked: Path) -> None:
    text = html_report(talked)
    root = parse(text)
    assert EVIL not in text
    assert not every(root, "script")
    assert EVIL in [content(e) for e in every(root, "dd")]
