"""Start or resume a campaign in a process of its own, for tests that kill it: ``python processes.py DIR``."""

import sys
from pathlib import Path

from falsifier.campaigns import resume_campaign, run_campaign
from falsifier.campaigns.directory import is_campaign
from tests.campaigns.support import request

WANTED = request("held_hard", "held_impossible", seeds=3, budget=40)


def work(directory: Path) -> None:
    """Go on with the campaign of the directory, or start it."""
    if is_campaign(directory):
        resume_campaign(directory, jobs=2)
    else:
        run_campaign(WANTED, directory, jobs=2)


if __name__ == "__main__":
    work(Path(sys.argv[1]))
