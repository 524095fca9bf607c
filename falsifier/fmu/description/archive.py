"""Archives of FMUs and other models: checked before any of their contents are written to disk or loaded."""

import hashlib
import platform
import stat
import sys
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from falsifier.errors import ModelError, ModelFileError, SpecError, remedy

try:
    from lzma import LZMAError
except ImportError:  # some builds of Python have no lzma; then no archive can be packed with it
    LZMAError = zlib.error  # type: ignore[misc,assignment]

# Far more than exporters write (a few MB, or several hundred with tables), far less than fills a disk.
_MAX_BYTES = 8 << 30
_MAX_FILES = 100_000
# A description of 100,000 variables takes 20 to 30 MB and seconds to read.
_MAX_TEXT_BYTES = 128 << 20
# Text compresses by a factor of 5 to 20, a file of zeros by 1000: only a zip bomb is large and dense.
_MAX_COMPRESSION = 300
_DENSE_FROM_BYTES = 256 << 20
# What a method may add to data that it cannot compress.
_MAX_OVERHEAD, _MAX_EXPANSION = 1024, 1.01
# Limits of usual file systems in bytes; the second one leaves room for the folder that is unpacked to.
_MAX_NAME_BYTES, _MAX_PATH_BYTES = 255, 2048
# Of a name in a message.
_SHOWN_CHARACTERS = 100

# FMI 3 names of machines, where the system has others.
_MACHINES = {"amd64": "x86_64", "i386": "x86", "i686": "x86", "arm64": "aarch64"}
# FMI 3 names of the folders of FMI 1 and 2. FMI 2 defines none for ARM; tools use the FMI 3 names there.
OLD_PLATFORMS = {
    "linux64": "x86_64-linux",
    "linux32": "x86-linux",
    "win64": "x86_64-windows",
    "win32": "x86-windows",
    "darwin64": "x86_64-darwin",
}
# The platform whose libraries run on Linux too, through Wine.
WINDOWS = "x86_64-windows"
# What an archive is called, by the ending of its name; all others are taken for FMUs.
_KINDS = {".ssp": "SSP package", ".slx": "Simulink file"}
# What reading an entry of a damaged archive raises. RuntimeError stands for entries that are encrypted or
# compressed by an unknown method, OSError also for damaged bzip2 data, ValueError for names in no encoding.
_UNREADABLE = (zipfile.BadZipFile, zlib.error, LZMAError, EOFError, OSError, RuntimeError, ValueError)
_FORBIDDEN_KINDS = {
    stat.S_IFLNK: "symbolic link",
    stat.S_IFIFO: "named pipe",
    stat.S_IFSOCK: "socket",
    stat.S_IFCHR: "device",
    stat.S_IFBLK: "device",
}
_LIBRARY_SUFFIX = {"linux": ".so", "darwin": ".dylib", "windows": ".dll"}


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits; ModelError if the file cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ModelError(
            f"{path}: cannot be read ({error.strerror or error}); give the path of an FMU or SSP package"
        ) from error


@contextmanager
def _open_archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open an FMU, SSP package or Simulink file after checking its entries.

    Raises:
        ModelFileError: if it is not a zip archive, or would write outside its folder or fill the disk.
        ModelError: if it cannot be read.
    """
    try:
        archive = zipfile.ZipFile(path)
    except FileNotFoundError:
        raise ModelError(f"{path}: no such file; correct the path") from None
    except _UNREADABLE as error:
        what = _KINDS.get(path.suffix.lower(), "FMU")
        raise _damaged(f"{path}: not a readable {what}, which is a zip archive", error) from error
    with archive:
        for entry in archive.infolist():  # some tools write the names as Windows knows them
            entry.filename = entry.filename.replace("\\", "/")
        archive.NameToInfo = {entry.filename: entry for entry in archive.infolist()}
        for fault in _faults(archive.infolist()):
            raise ModelFileError(f"{path}: {fault}")
        yield archive


def read_entry(path: Path, name: str, first: int | None = None) -> bytes:
    """Return the contents of one text file of an FMU, or the first bytes of any file.

    Raises:
        ModelFileError: if the archive is damaged or rejected, or has no such file or a too large one.
        ModelError: if it cannot be read.
    """
    with _open_archive(path) as archive:
        try:
            size = archive.getinfo(name).file_size
            if first is None and size > _MAX_TEXT_BYTES:
                raise ModelFileError(
                    f"{path}: {name} has {size >> 20} MiB, more than {_MAX_TEXT_BYTES >> 20}; export the "
                    "model with fewer variables"
                )
            with archive.open(name) as file:
                return file.read() if first is None else file.read(first)
        except KeyError:
            raise ModelFileError(
                f"{path}: the archive contains no {name}, so it is not an FMU; export the model again"
            ) from None
        except _UNREADABLE as error:
            raise _damaged(f"{path}: {name} is damaged", error) from error


def read_entries(
    path: Path, names: Iterable[str], largest: int, *, smaller: str, again: str
) -> Iterator[tuple[str, bytes]]:
    """Yield the names and contents of these files of an archive that a user named.

    Raises:
        SpecError: naming a file that has more bytes than the ``largest``, and what makes it ``smaller``, or
            one that is damaged, and what writes it ``again``.
        ModelError: as of ``read_entry``.
    """
    with _open_archive(path) as archive:
        for name in names:
            size = archive.getinfo(name).file_size
            if size > largest:
                raise SpecError(f"{path}: {name} has {size >> 20} MiB, more than {largest >> 20}; {smaller}")
            try:
                content = archive.read(name)
            except _UNREADABLE as error:
                raise SpecError(f"{path}: {name} is damaged ({error}); {again}") from None
            yield name, content


def extract(path: Path, folder: Path) -> None:
    """Unpack an FMU into a folder after checking its entries.

    Raises:
        ModelFileError: if the archive is damaged or rejected.
        OSError: if the machine has no room for it, or allows no files so large.
    """
    with _open_archive(path) as archive:
        try:
            archive.extractall(folder)
        except _UNREADABLE as error:
            if isinstance(error, OSError) and remedy(error):  # the machine's fault and not the archive's
                error.filename = f"{folder}, to which {path} is unpacked"
                raise
            raise _damaged(f"{path}: cannot be unpacked into {folder}", error) from error


def _damaged(what: str, error: Exception) -> ModelError:
    """Return the error of a file that is no archive, or a damaged one, or that the system does not read."""
    if isinstance(error, OSError) and error.errno is not None:
        return ModelError(f"{what} ({error})")
    return ModelFileError(f"{what} ({error}); copy the file again, or have its tool write it again")


def entry_names(path: Path) -> tuple[str, ...]:
    """Return the names of all files in an FMU, with forward slashes."""
    with _open_archive(path) as archive:
        return tuple(archive.namelist())


def this_platform() -> str:
    """Return the FMI 3 name of the platform that this Python runs on."""
    machine = platform.machine().lower()
    return f"{_MACHINES.get(machine, machine)}-{sys.platform}"


def library_file(fmi_version: str, identifier: str, platform: str) -> PurePosixPath:
    """Return the path inside an FMU of the library of a model identifier for a platform."""
    folder = platform
    if not fmi_version.startswith("3"):
        folder = next((old for old, new in OLD_PLATFORMS.items() if new == platform), platform)
    suffix = _LIBRARY_SUFFIX.get(platform.rpartition("-")[2], ".so")
    return PurePosixPath("binaries", folder, identifier + suffix)


def _faults(entries: list[zipfile.ZipInfo]) -> Iterator[str]:
    """Yield why an archive with these entries is not opened."""
    if len(entries) > _MAX_FILES:
        yield f"rejected because it contains {len(entries)} files; at most {_MAX_FILES} are allowed"
    total = sum(entry.file_size for entry in entries)
    if total > _MAX_BYTES:
        yield (
            f"rejected because it would unpack to {total / 2**30:.1f} GiB; at most "
            f"{_MAX_BYTES >> 30} GiB are allowed"
        )
    # Some tools list folders several times, which does no harm.
    files = Counter(entry.filename for entry in entries if not entry.is_dir())
    yield from (f"rejected because it contains {name!r} {n} times" for name, n in files.items() if n > 1)
    folders = {str(folder) for entry in entries for folder in PurePosixPath(entry.filename).parents}
    folders |= {entry.filename.rstrip("/") for entry in entries if entry.is_dir()}
    both = folders & files.keys()
    for entry in entries:
        shown = entry.orig_filename[:_SHOWN_CHARACTERS]
        yield from (f"rejected because its entry {shown!r} {fault}" for fault in _faults_of(entry))
        if entry.filename in both:
            yield f"rejected because its entry {shown!r} is both a file and a folder"


def _faults_of(entry: zipfile.ZipInfo) -> Iterator[str]:
    # zipfile truncates names at NUL: check the name as it was written.
    written = entry.orig_filename.replace("\\", "/")
    parts = written.split("/")
    if written.startswith("/") or ":" in parts[0] or ".." in parts or "\0" in written:
        yield "would be written outside the folder that it is unpacked to"
    if any(ord(character) < 32 or ord(character) == 127 for character in written):
        yield "has a control character in its name"
    longest = max(len(part.encode("utf-8", "replace")) for part in parts)
    if longest > _MAX_NAME_BYTES or len(written.encode("utf-8", "replace")) > _MAX_PATH_BYTES:
        yield (
            f"has too long a name for file systems (at most {_MAX_NAME_BYTES} bytes per name, "
            f"{_MAX_PATH_BYTES} per path)"
        )
    size, mode, packed = entry.file_size, entry.external_attr >> 16, entry.compress_size
    kind = _FORBIDDEN_KINDS.get(stat.S_IFMT(mode))
    if kind is not None:
        yield f"is a {kind}"
    if mode & (stat.S_ISUID | stat.S_ISGID):
        yield "asks for its owner's rights (setuid)"
    if entry.flag_bits & 0x1:
        yield "is encrypted; save it without a password"
    if size > max(_MAX_COMPRESSION * max(packed, 1), _DENSE_FROM_BYTES):
        yield f"grows from {packed} to {size} bytes, like a zip bomb"
    if packed > _MAX_EXPANSION * size + _MAX_OVERHEAD:
        yield f"declares {size} bytes, but {packed} are stored; export the model again"
