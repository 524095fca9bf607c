"""The directory of a campaign.

::

    campaign.json     what was requested, with which versions and files; written once
    runs/NAME/        one run directory per run
    stop              exists while the campaign is being stopped, also by another process; contains the reason
    lock              held while a process works on this campaign
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from pydantic import Field

from falsifier.campaigns.request import CampaignRequest
from falsifier.core.literals import shell_word
from falsifier.errors import JournalError, warn_once
from falsifier.record.files import CAMPAIGN, is_locked, locked, make_folder, read_sealed, write_sealed
from falsifier.record.journal import JOURNAL, LOCK, holds_run
from falsifier.record.manifest import MANIFEST, Surroundings, runs_below


class CampaignRecord(Surroundings):
    """Content of campaign.json."""

    request: CampaignRequest
    hashes: dict[str, str] = Field(description="SHA-256 of all FMUs and specs, by path.")
    sum: str = Field("", description="Checksum of the file up to the comma before it.")


def is_campaign(directory: Path) -> bool:
    """Whether a directory contains a campaign."""
    return (directory / CAMPAIGN).exists()


def write_campaign(directory: Path, record: CampaignRecord) -> None:
    """Write campaign.json."""
    write_sealed(directory / CAMPAIGN, record)


def read_campaign(directory: Path) -> CampaignRecord:
    """Read campaign.json; JournalError if there is none, or it is invalid."""
    return read_sealed(directory / CAMPAIGN, CampaignRecord, what="campaign")


def run_directory(directory: Path, name: str) -> Path:
    """Directory of one run."""
    return directory / "runs" / name


def run_directories(directory: Path) -> list[Path]:
    """Directories of all runs that have started, in the campaign's order.

    For a run directory, itself. For a folder that is neither but contains run directories, those. A warning
    tells which ones have lost their manifest.

    Raises:
        JournalError: if the directory contains neither a campaign nor a run.
    """
    if is_campaign(directory):
        places = [run_directory(directory, name) for name in read_campaign(directory).request.named()]
        return _known(places, f"falsifier tools repair {shell_word(directory)} lets the campaign repeat it")
    if holds_run(directory):
        return [directory]
    places = sorted({*runs_below(directory), *runs_below(directory, JOURNAL)})
    if below := _known(places, "put that file back"):
        return below
    if not directory.exists():
        raise JournalError(f"{directory}: no such directory; expected that of a run or campaign")
    raise JournalError(
        f"{directory}: not a run or campaign directory: it contains neither {CAMPAIGN} nor a run's manifest"
    )


def _known(places: Sequence[Path], remedy: str) -> list[Path]:
    """Return the directories that are runs, and warn of those of which there is only what happened."""
    found = []
    for place in places:
        if holds_run(place):
            found.append(place)
        elif (place / JOURNAL).exists() and (place / JOURNAL).stat().st_size:
            # It is empty until a run that begins has written its manifest.
            why = f"it has a journal, but no {MANIFEST}, which says what was searched"
            warn_once(f"{place} is left out: {why}; {remedy}")
    return found


def campaign_lock(directory: Path) -> AbstractContextManager[None]:
    """Hold the campaign's lock; JournalError if another process holds it."""
    make_folder(directory)
    busy = (
        f"{directory}: another process is working on this campaign; wait until it ends, or follow it: "
        f"falsifier watch {shell_word(directory)}"
    )
    return locked(directory / LOCK, busy=busy)


def is_worked_on(directory: Path) -> bool:
    """Whether a process holds the campaign's lock; that of a killed process is released by the system."""
    path = directory / LOCK
    return path.exists() and is_locked(path)
