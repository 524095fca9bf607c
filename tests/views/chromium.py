"""A real browser for the tests of pages: they run where a Chromium is installed.

``CHROMIUM`` names it, or it is on the path; CI installs one.
"""

import html
import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.patience import HANG

CHROMIUM = os.environ.get("CHROMIUM") or next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None
)
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed; CI installs one")


def chromium(*arguments: str, profile: Path) -> str:
    """Run it without a window; return what it prints."""
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


def attribute(dom: str, name: str) -> Any:
    """Return what a script has left in an attribute of the page, as JSON."""
    found = re.search(f'{name}="([^"]*)"', dom)
    assert found, f"the script that sets {name} did not run"
    return json.loads(html.unescape(found.group(1)))
