"""FMUs that change, read, execute and signal what is not theirs: it is refused, and failures say so.

Everything that they try is of fixed names in a folder of the test, and each test runs in a process that can
change nothing outside that folder whatever the worker's own sandbox lets through (``cage``).
"""

import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.fmu.fixtures import path
from tests.fmu.support import python
from tests.hostile import cage
from tests.hostile.test_fmus import children, have_ended

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="the test FMUs are built for Linux"),
    pytest.mark.skipif(cage.version() < 3, reason="this system cannot confine hostile tests a second time"),
]

# As in tests/fixtures/fmus/src/hostile.h; CRASH makes a simulation fail after a misdeed.
NOTHING, CRASH = 0, 11
(
    CHANGE,
    READ_KEY,
    EXECUTE,
    BECOME,
    MEDDLE,
    DAEMONISE,
    BIG_FILE,
    SHARE,
    SHUT,
    REDIRECT,
    CONNECT,
    LEND,
    SWARM,
) = range(13, 26)
CLOSE = 9
WAYS = (
    "create", "overwrite", "rename", "truncate", "delete", "make a folder", "make a link", "link",
    "link into its folder", "change permissions", "truncate while opening for reading",
    "write through a link", "change permissions of an open file", "move a file out of its folder",
    "change times", "change its version", "lease",
)  # fmt: skip
CREATE, OVERWRITE = WAYS.index("create"), WAYS.index("overwrite")
TRUNCATE = WAYS.index("truncate")

SCRIPT = """
import os, sys
from pathlib import Path
from tests.hostile import cage
cage.enter(Path(os.environ["TMPDIR"]))
{before}
from falsifier.core.experiment import Experiment
from falsifier.errors import FalsifierError
from falsifier.fmu import FmuModel

fmu, misdeed, variant, *rights = sys.argv[1:]
allow = [each for each in rights if each != "network"]
model = FmuModel(Path(fmu), allow=tuple(allow), deny=tuple(set(rights) - set(allow)))
def tried(misdeed, variant=0):
    experiment = Experiment(1.0, 0.1, ("y",), None, None, 60.0)
    try:
        found = model.simulate({}, {"misdeed": misdeed, "variant": variant, "moment": 0.86}, experiment)
        return f"{found['y'][-1]:g} {' '.join(found.log)}"
    except FalsifierError as error:
        return f"{type(error).__name__} {getattr(error, 'status', '')}: {error}"
print(tried(int(misdeed), int(variant)), flush=True)
"""


@dataclass(frozen=True)
class Place:
    """A folder of the test with a home, and files that hostile FMUs are led to."""

    root: Path

    @property
    def home(self) -> Path:
        return self.root / "home"

    def run(
        self,
        misdeed: int,
        variant: int = 0,
        *rights: str,
        at: Path | None = None,
        before: str = "",
        more: str = "",
    ) -> str:
        """Let an FMU do something to files of fixed names in a folder; return what came of it."""
        script = SCRIPT.replace("{before}", before) + more
        folders = {"HOME": self.home, "TMPDIR": self.root, "HOSTILE_LICENSE": at or self.home}
        environment = {name: str(folder) for name, folder in folders.items()}
        environment["PYTHONDONTWRITEBYTECODE"] = "1"
        done = python(script, str(path("Hostile_2")), str(misdeed), str(variant), *rights, **environment)
        done.check_returncode()
        return done.stdout


@pytest.fixture
def place(tmp_path: Path) -> Place:
    found = Place(tmp_path)
    (found.home / ".ssh").mkdir(parents=True)
    (found.home / ".ssh" / "id").write_text("hostile-test-secret")
    (found.home / "victim").write_text("content")
    return found


def content(folder: Path) -> dict[str, tuple[int, bytes]]:
    """Modes and contents of the files and links of a folder, by name."""
    return {
        each.name: (each.lstat().st_mode, each.read_bytes() if each.is_file() else b"")
        for each in folder.iterdir()
        if not each.name.startswith("falsifier-fmu-")
    }


# A system with all services, one without Landlock's first call, and one without the flag with which a filter
# of system calls asks a guard.
ALL = ""
NO_LANDLOCK = "import errno; cage.without(444, errno.EOPNOTSUPP)"
NO_GUARD = "import errno; cage.without(317 if os.uname().machine == 'x86_64' else 277, errno.EBUSY, 8)"


@pytest.mark.parametrize("before", [ALL, NO_LANDLOCK, NO_GUARD], ids=["all", "no Landlock", "no guard"])
def test_files_of_others_cannot_be_changed(place: Place, before: str) -> None:
    known = content(place.home)
    times = (place.home / "victim").stat().st_mtime_ns
    more = f"for way in range(1, {len(WAYS)}):\n    print(tried({CHANGE}, way))\n"
    said = place.run(CHANGE, 0, before=before, more=more).splitlines()
    assert {way: line.split()[0] for way, line in zip(WAYS, said, strict=True)} == dict.fromkeys(WAYS, "0")
    assert content(place.home) == known
    assert (place.home / "victim").stat().st_mtime_ns == times


STAYS = f"""
from tests.fmu.fixtures import worker
pid, link = worker(model).program.pid, Path(os.environ["HOSTILE_LICENSE"]) / "victim"
def try_behind(target, times):
    link.unlink()
    link.symlink_to(target)
    return [tried({CHANGE}, {TRUNCATE}).split()[0] for _ in range(times)]
def memory():
    return int(Path(f"/proc/{{pid}}/status").read_text().split("VmRSS:")[1].split()[0])
"""


def test_the_guard_survives_links_to_what_has_no_path(place: Place) -> None:
    """Descriptor 5 is its line, a socket."""
    more = f"{STAYS}print(try_behind('/proc/self/fd/5', 3), worker(model).program.pid == pid)"
    assert place.run(NOTHING, more=more).splitlines()[-1] == "['0', '0', '0'] True"


def test_no_advice_helps_with_files_without_a_name(place: Place) -> None:
    """What is known of them is neither the link's folder nor ``/``, where the system says that they are."""
    (place.home / "victim").unlink()
    link = f"Path({str(place.home)!r}, 'victim').symlink_to(f'/proc/{{os.getpid()}}/fd/{{memory}}')"
    said = place.run(CHANGE, 100 + OVERWRITE, before=f"memory = os.memfd_create('memory')\n{link}")
    assert said.startswith("SimulationError failed") and "refused" not in said


def test_the_guard_keeps_no_memory_of_what_it_does_not_tell(place: Place) -> None:
    """It tells of 32 files. Each of the last simulations has a call refused, for a path of 3 kB."""
    deep = place.home.joinpath(*(16 * ["x" * 200]))
    deep.mkdir(parents=True)
    more = f"""{STAYS}
for k in range(40):
    (link.parent / str(k)).touch()
    try_behind(link.parent / str(k), 1)
target = Path({str(deep)!r}, "file")
target.touch()
try_behind(target, 20)
before = memory()
try_behind(target, 300)
print(memory() - before < 300)
"""
    assert place.run(NOTHING, more=more).splitlines()[-1] == "True"


@pytest.mark.parametrize("before", [ALL, NO_LANDLOCK])
def test_its_own_folder_is_its_own(place: Place, before: str) -> None:
    assert place.run(CHANGE, -1, before=before).split()[0] == "1"


@pytest.mark.parametrize("before", [ALL, NO_LANDLOCK])
def test_nobody_gets_the_rights_of_this_user_by_its_files(place: Place, before: str) -> None:
    assert place.run(LEND, before=before).split()[0] == "0"


@pytest.mark.parametrize("before", [ALL, NO_GUARD])
def test_programs_cannot_be_executed_unless_that_is_allowed(place: Place, before: str) -> None:
    assert place.run(EXECUTE, before=before).split()[0] == "0"
    assert place.run(EXECUTE, 0, "programs", before=before).split()[0] == "1"


OTHER = """
model.close()
other = FmuModel(Path(fmu).with_name("Lag_2.fmu"))
other.simulate(dict(), dict(), Experiment(1.0, 0.1, ("y",)))
found = Path(os.environ["TMPDIR"]).glob("*/*/0/modelDescription.xml")
(folder,) = (each.parent for each in found if 'modelName="Lag"' in each.read_text())
(folder / "victim").write_text("content")
os.environ["HOSTILE_LICENSE"] = str(folder)
before = sorted(folder.rglob("*"))
print(*(tried({}, k).split()[0] for k in range({})))
print((folder / "victim").read_text(), sorted(folder.rglob("*")) == before)
"""


def test_nor_can_the_unpacked_files_of_another_fmu(place: Place) -> None:
    said = place.run(0, 0, more=OTHER.format(CHANGE, len(WAYS))).splitlines()
    assert said[1:] == [" ".join("0" * len(WAYS)), "content True"]


def test_a_folder_can_be_allowed(place: Place) -> None:
    (place.home / "logs").mkdir()
    (place.home / "logs" / "victim").write_text("content")
    allowed = f"write:{place.home / 'logs'}"
    assert place.run(CHANGE, CREATE, allowed, at=place.home / "logs").split()[0] == "1"
    assert place.run(CHANGE, OVERWRITE, allowed, at=place.home / "logs").split()[0] == "1"
    assert (place.home / "logs" / "victim").read_text() == "!ontent"
    assert place.run(CHANGE, OVERWRITE, allowed).split()[0] == "0", "not those above it"
    assert (place.home / "victim").read_text() == "content"


def test_keys_cannot_be_read_unless_that_is_allowed(place: Place) -> None:
    assert place.run(READ_KEY).split()[0] == "0"
    assert place.run(READ_KEY, 0, f"read:{place.home / '.ssh'}").split()[0] == "1"


def test_what_may_be_changed_above_keys_does_not_show_them(place: Place) -> None:
    allowed = f"write:{place.home}"
    assert place.run(CHANGE, CREATE, allowed).split()[0] == "1"
    assert place.run(READ_KEY, 0, allowed).split()[0] == "0"
    assert place.run(READ_KEY, 0, f"write:{place.home / '.ssh'}").split()[0] == "1", "named itself"


def test_a_link_beside_hidden_keys_does_not_lead_to_them(place: Place) -> None:
    (place.home / "links").mkdir()
    (place.home / "links" / ".ssh").symlink_to("../.ssh")
    (place.home / "visible").write_text("content")
    assert place.run(READ_KEY, at=place.home / "links").split()[0] == "0"
    (place.home / "links" / ".ssh").unlink()
    (place.home / "links" / ".ssh").mkdir()
    (place.home / "links" / ".ssh" / "id").symlink_to("../../visible")
    assert place.run(READ_KEY, at=place.home / "links").split()[0] == "1", "the rest of the home is readable"


def test_connections_can_be_denied(place: Place) -> None:
    assert place.run(CONNECT).split()[0] == "1", "for licence servers"
    assert place.run(CONNECT, 0, "network").split()[0] == "0"


@pytest.fixture
def decoy() -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(["sleep", "1000"])
    yield process
    process.kill()
    process.wait()


@pytest.mark.parametrize("before", [ALL, NO_GUARD])
def test_other_processes_are_out_of_reach(
    place: Place, decoy: subprocess.Popen[bytes], monkeypatch: pytest.MonkeyPatch, before: str
) -> None:
    monkeypatch.setenv("HOSTILE_LICENSE_PID", str(decoy.pid))
    assert place.run(MEDDLE, before=before).split()[0] == "0"
    assert decoy.poll() is None


def test_a_daemon_ends_with_the_process(place: Place) -> None:
    said = place.run(DAEMONISE)
    pids = children((said,))
    assert len(pids) == 1 and have_ended(pids)


def test_a_failure_tells_what_was_refused_before(place: Place) -> None:
    said = place.run(CHANGE, 100 + OVERWRITE)
    assert said.startswith("SimulationError failed")
    assert str(place.home / "victim") in said and f"allow=['write:{place.home}']" in said
    said = place.run(CHANGE, 100 + CREATE, at=Path("/dev/shm"))
    assert "allow=['write:/dev/shm']" in said, "shared memory and semaphores, which are no devices"
    said = place.run(EXECUTE, 100)
    assert "/bin/sh" in said and "allow=['programs']" in said
    assert "refused" not in place.run(CRASH)


@pytest.mark.parametrize("misdeed", [CLOSE, REDIRECT])
def test_an_fmu_that_loses_its_descriptors_has_cut_its_connection(place: Place, misdeed: int) -> None:
    said = place.run(misdeed)
    assert said.startswith("SimulationError crashed") and "cut the connection" in said
    assert signal.Signals.SIGKILL.name not in said


def test_descriptors_cannot_be_shut_down(place: Place) -> None:
    assert place.run(SHUT).split()[0] == "10"


def test_a_replaced_program_is_named(place: Place) -> None:
    said = place.run(BECOME, 0, "programs")
    assert said.startswith("SimulationError crashed") and "replaced its program by /bin/true" in said
    assert place.run(BECOME).split()[0] == "0"


def test_a_file_cannot_outgrow_the_limit(place: Place) -> None:
    assert place.run(BIG_FILE).split()[0] == "-1", "writing fails, and the simulation goes on"


SMALL = """
from falsifier.fmu.process import start
start._MEMORY_SHARE = 1e8 / start.posix.machine_memory()
print(tried({}))
"""


@pytest.mark.parametrize(("variant", "reason"), [(0, "more memory than it may"), (1, "SIGKILL")])
def test_shared_memory_counts(place: Place, variant: int, reason: str) -> None:
    """Also if the first thread has ended, without which the system does not tell how much there is."""
    said = place.run(0, 0, more="model.close()\n" + SMALL.format(f"{SHARE}, {variant}")).splitlines()
    assert said[1].startswith("SimulationError crashed") and reason in said[1]


def test_threads_are_limited(place: Place) -> None:
    assert float(place.run(SWARM).split()[0]) < 8200
