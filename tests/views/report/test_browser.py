"""The page in a real browser: pictures are drawn, scripts do not run, nothing is asked of the network."""

from base64 import b64encode
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from falsifier.views.report import html_report
from tests.command import ROOT
from tests.views.chromium import attribute, chromium, needs_chromium

pytestmark = needs_chromium

# Runs in the browser when the page is loaded: what a person would see and could reach. It is added to the
# page's policy, which forbids scripts.
PROBE = (ROOT / "tests" / "fixtures" / "probe.js").read_text()


def probe(page: Path, folder: Path, *flags: str) -> Any:
    probed = folder / "probed.html"
    digest = b64encode(sha256(PROBE.encode()).digest()).decode()
    text = page.read_text(encoding="utf-8").replace("</body>", f"<script>{PROBE}</script></body>")
    policy = "default-src &#x27;none&#x27;; "
    assert policy in text
    probed.write_text(text.replace(policy, f"{policy}script-src 'sha256-{digest}'; ", 1), encoding="utf-8")
    return attribute(
        chromium("--dump-dom", *flags, probed.as_uri(), profile=folder / "profile"), "data-probe"
    )


@pytest.fixture(scope="module")
def page(campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(html_report(campaign), encoding="utf-8")
    return path


@pytest.mark.parametrize("width", [1300, 700, 500])
def test_everything_is_drawn_and_reached_by_keyboard(page: Path, tmp_path: Path, width: int) -> None:
    seen = probe(page, tmp_path, f"--window-size={width},5000")
    assert seen["pictures"] == seen["drawn"] == 2, "one in each card; the others are folded"
    assert seen["reached"] == seen["focusable"]
    assert seen["resources"] == 0
    assert seen["sideways"] == 0
    assert seen["ink"] == "rgb(27, 31, 36)"
    assert seen["edges"] == ["rgb(179, 38, 30)", "rgb(47, 125, 79)"], "violated is red, the other green"


def test_a_foreign_script_does_not_run(page: Path, tmp_path: Path) -> None:
    attacked = tmp_path / "attacked.html"
    attack = "<script>document.documentElement.setAttribute('data-evil', '1')</script>"
    image = "<img src=x onerror=\"document.documentElement.setAttribute('data-evil', '2')\">"
    text = page.read_text(encoding="utf-8")
    attacked.write_text(text.replace("</body>", f"{attack}{image}</body>"), encoding="utf-8")
    dom = chromium("--dump-dom", "--virtual-time-budget=5000", attacked.as_uri(), profile=tmp_path / "p")
    assert 'class="card violated"' in dom
    assert "data-evil=" not in dom


def test_dark_mode_turns_the_colours_round(page: Path, tmp_path: Path) -> None:
    seen = probe(page, tmp_path, "--blink-settings=preferredColorScheme=0", "--window-size=1200,5000")
    assert (seen["ink"], seen["page"]) == ("rgb(230, 233, 237)", "rgb(20, 24, 29)")
