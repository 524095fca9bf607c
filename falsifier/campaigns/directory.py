"""The directory of a campaign.

::

    campaign.json     what was asked for, and with which versions and files; written once
    runs/NAME/        one run directory for each run
    stop              there while a campaign is being stopped; its text says why
    lock              held while a process works on this campaign
"""

from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path

from filelock import FileLock, Timeout
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from falsifier.campaigns.plan import CampaignRequest
from falsifier.core.files import write_whole
from falsifier.errors import JournalError
from falsifier.search.journal import holds_run
from falsifier.search.request import RunRequest

CAMPAIGN = "campaign.json"
STOP = "stop"
_LOCK = "lock"
# How long in s to wait for the lock: who looks whether it is held holds it for a moment.
_LOCK_PATIENCE = 0.5


class CampaignRecord(BaseModel):
    """Content of campaign.json."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    falsifier: str = Field(description="Version of this package.")
    python: str
    platform: str
    packages: dict[str, str] = Field(description="Versions of the packages that decide numbers.")
    started: str = Field(description="Date and time in UTC.")
    request: CampaignRequest
    hashes: dict[str, str] = Field(description="SHA-256 by path of all FMUs and specs.")

    @property
    def runs(self) -> dict[str, RunRequest]:
        """Runs by the name of their directory."""
        return self.request.named()


def is_campaign(directory: Path) -> bool:
    """Whether a directory holds a campaign."""
    return (directory / CAMPAIGN).exists()


def write_campaign(directory: Path, record: CampaignRecord) -> None:
    """Write campaign.json."""
    write_whole(directory / CAMPAIGN, record.model_dump_json(indent=1) + "\n")


def read_campaign(directory: Path) -> CampaignRecord:
    """Read campaign.json.

    Raises:
        JournalError: when there is none, or it cannot be understood.
    """
    try:
        return CampaignRecord.model_validate_json((directory / CAMPAIGN).read_bytes())
    except FileNotFoundError:
        raise JournalError(f"{directory}: not a campaign directory, it has no {CAMPAIGN}") from None
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise JournalError(f"{directory}/{CAMPAIGN}: {key}: {first['msg']}") from None


def campaign_mark(directory: Path) -> str:
    """Hash by which a worker knows that it sees the very same directory; empty where there is no campaign."""
    path = directory / CAMPAIGN
    return sha256(path.read_bytes()).hexdigest() if path.exists() else ""


def run_directory(directory: Path, name: str) -> Path:
    """Directory of one run."""
    return directory / "runs" / name


def run_directories(directory: Path) -> list[Path]:
    """Directories of all runs that have begun, in the campaign's order.

    A run directory is its own only run. A folder that is neither, but holds run directories, has those.

    Raises:
        JournalError: when the directory holds neither a campaign nor a run.
    """
    if is_campaign(directory):
        named = read_campaign(directory).runs
        return [p for n in named if holds_run(p := run_directory(directory, n))]
    if holds_run(directory):
        return [directory]
    below = sorted(path for path in directory.glob("*") if holds_run(path))
    if below:
        return below
    raise JournalError(f"{directory}: neither a campaign nor a run: no {CAMPAIGN} and no manifest")


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Hold the campaign's lock.

    Raises:
        JournalError: when another process holds it.
    """
    directory.mkdir(parents=True, exist_ok=True)
    lock = FileLock(directory / _LOCK)
    try:
        lock.acquire(timeout=_LOCK_PATIENCE)
    except Timeout:
        raise JournalError(f"{directory}: another process is working on this campaign") from None
    try:
        yield
    finally:
        lock.release()


def is_worked_on(directory: Path) -> bool:
    """Whether a process holds the campaign's lock: one that was killed, however it was, holds it no more."""
    path = directory / _LOCK
    if not path.exists():
        return False
    try:
        with FileLock(path, timeout=0):
            return False
    except (Timeout, OSError):  # OSError: who may only read cannot tell
        return True
