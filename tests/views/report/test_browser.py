"""The page in a real browser: plots are drawn, foreign scripts do not run, nothing is asked of the network.

Runs where a Chromium is installed (``CHROMIUM`` names it, or it is on the path); test_page.py checks the
page's structure everywhere.
"""

import html
import json
import os
import re
import shutil
import subprocess
from base64 import b64encode
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import pytest

from falsifier.campaigns.analysis import Table
from falsifier.views.report import html_report
from falsifier.views.report.content import gather
from falsifier.views.report.page import page as page_of
from tests.patience import HANG

CHROMIUM = os.environ.get("CHROMIUM") or next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None
)
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed; CI installs one")

# Virtual time in ms. Waiting takes none; on a busy machine much of it passes before a frame is drawn.
DAY = 24 * 3600 * 1000
# Runs in the browser when the plots are drawn: what a person would see and could reach. It is added to the
# page's policy, which forbids foreign scripts.
PROBE = """

const canvas = plot => plot.firstElementChild?.shadowRoot?.querySelector("canvas, .bk-CanvasView")
  ?? plot.firstElementChild;
const done = () => [...document.querySelectorAll('.plot')].filter(e => e.checkVisibility()).every(canvas);
const look = () => {
const focusable = [...document.querySelectorAll('a[href], summary, [tabindex="0"]')]
  .filter(e => e.checkVisibility());
const reached = focusable.filter(e => { e.focus(); return document.activeElement === e; });
const charts = [...document.querySelectorAll('.plot')].filter(e => e.checkVisibility());
const sizes = charts.map(canvas).map(e => e.getBoundingClientRect());
const drawn = sizes.filter(e => e.height > 150 && e.width > 300);
const ink = getComputedStyle(document.body).color, page = getComputedStyle(document.body).backgroundColor;
document.documentElement.setAttribute('data-probe', JSON.stringify({
  focusable: focusable.length, reached: reached.length, charts: charts.length, drawn: drawn.length,
  sideways: document.documentElement.scrollWidth - document.documentElement.clientWidth, ink, page,
  resources: performance.getEntriesByType('resource').length,
  wide: [...document.querySelectorAll('.scroll')]
    .filter(e => e.checkVisibility() && e.scrollWidth > e.clientWidth).map(e => e.ariaLabel),
  rows: document.querySelectorAll('#summary > .scroll tbody tr').length,
  numbers: [...document.querySelectorAll('details.numbers')].filter(e => e.open).length,
}));
};
const wait = () => (done() ? setTimeout(look, 200) : setTimeout(wait, 50));
wait();
"""


def chromium(*arguments: str, profile: Path) -> str:
    command = [
        str(CHROMIUM),
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        f"--user-data-dir={profile}",
        *arguments,
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANG, check=True)
    return done.stdout


def probe(page: Path, folder: Path, *flags: str) -> dict[str, object]:
    probed = folder / "probed.html"
    digest = b64encode(sha256(PROBE.encode()).digest()).decode()
    text = page.read_text(encoding="utf-8").replace("</body>", f"<script>{PROBE}</script></body>")
    probed.write_text(text.replace("script-src ", f"script-src 'sha256-{digest}' ", 1), encoding="utf-8")
    dom = chromium(
        "--dump-dom", f"--virtual-time-budget={DAY}", *flags, probed.as_uri(), profile=folder / "profile"
    )
    found = re.search(r'data-probe="([^"]*)"', dom)
    assert found, "the probe did not run"
    result: dict[str, object] = json.loads(html.unescape(found.group(1)))
    return result


@pytest.fixture(scope="module")
def page(campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(html_report(campaign), encoding="utf-8")
    return path


def test_everything_is_drawn_and_reached_by_keyboard(page: Path, tmp_path: Path) -> None:
    seen = probe(page, tmp_path, "--window-size=1200,5000")
    assert seen["rows"] == 4
    assert seen["charts"] == seen["drawn"]
    # Two histories and a curve for each requirement; of its first simulation, which is open, x and u.
    assert seen["charts"] == 2 * (3 + 2)
    assert seen["numbers"] == 0
    assert seen["reached"] == seen["focusable"]
    assert seen["resources"] == 0
    assert seen["sideways"] == 0
    assert seen["wide"] == []
    assert seen["ink"] == "rgb(27, 31, 36)"


def test_a_table_with_published_columns_fits_on_a_screen(campaign: Path, tmp_path: Path) -> None:
    """On a narrow one it scrolls within its own box, and the page does not."""
    content = gather(campaign)
    header = (*content.table.header, "rank", "best ARCH-COMP tool", "LLM-Falsifier", "uniform random")
    method = "openai/gpt-5-mini-2025-08-07 MP4, high, free, anonymous"
    cells = ("12 (tie)", "FReaK 10 / 4.8", "10 / 1000.0", "10 / 1000.0")
    rows = tuple((row[0], method, *row[2:], *cells) for row in content.table.rows)
    file = tmp_path / "wide.html"
    table = Table("Falsification", header, rows)
    file.write_text(page_of(replace(content, table=table, sections=[])), encoding="utf-8")
    wide = probe(file, tmp_path, "--window-size=1300,5000")
    assert (wide["sideways"], wide["wide"]) == (0, [])
    narrow = probe(file, tmp_path, "--window-size=700,5000")
    assert (narrow["sideways"], narrow["wide"]) == (0, ["Falsification"])


def test_a_foreign_script_does_not_run(page: Path, tmp_path: Path) -> None:
    attacked = tmp_path / "attacked.html"
    attack = "<script>document.documentElement.setAttribute('data-evil', '1')</script>"
    image = "<img src=x onerror=\"document.documentElement.setAttribute('data-evil', '2')\">"
    text = page.read_text(encoding="utf-8")
    attacked.write_text(text.replace("</body>", f"{attack}{image}</body>"), encoding="utf-8")
    dom = chromium("--dump-dom", "--virtual-time-budget=5000", attacked.as_uri(), profile=tmp_path / "p")
    assert 'class="scripted"' in dom
    assert "data-evil=" not in dom


def test_without_scripts_the_numbers_are_open(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert text.count('class="numbers" open=""') == text.count('class="plots"') > 0


def test_a_telephone_is_wide_enough(page: Path, tmp_path: Path) -> None:
    seen = probe(page, tmp_path, "--window-size=500,5000")
    assert seen["sideways"] == 0


def test_dark_mode_turns_the_colours_round(page: Path, tmp_path: Path) -> None:
    seen = probe(page, tmp_path, "--blink-settings=preferredColorScheme=0", "--window-size=1200,5000")
    assert (seen["ink"], seen["page"]) == ("rgb(230, 233, 237)", "rgb(20, 24, 29)")


def test_it_prints_with_all_counterexamples(page: Path, tmp_path: Path) -> None:
    closed = tmp_path / "closed.html"
    text = page.read_text(encoding="utf-8")
    rule = "details:not([open])::details-content { content-visibility: visible; }"
    assert rule in text
    closed.write_text(text.replace(rule, ""), encoding="utf-8")
    assert pages(page, tmp_path) > pages(closed, tmp_path) >= 2


def pages(page: Path, folder: Path) -> int:
    """Number of pages that a document is printed on."""
    pdf = folder / f"{page.stem}.pdf"
    chromium(f"--print-to-pdf={pdf}", page.as_uri(), profile=folder / "profile")
    return len(re.findall(rb"/Type ?/Page\b", pdf.read_bytes()))
