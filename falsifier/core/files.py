"""File names made from any name, atomic writes, checksums, bundled and private folders."""

import os
import re
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from unicodedata import normalize

# Maximum length in bytes of what remains of a name; leaves room for the hash, prefixes and endings.
_LONGEST_NAME = 120
_HASH_DIGITS = 10
_LOOKS_HASHED = re.compile(rf"(^|-)[0-9a-f]{{{_HASH_DIGITS}}}$")
# The end of a JSON object that shows damage: its last key is a checksum of all the text before it.
_CHECKSUM_DIGITS = 16
_SEAL = re.compile(rb',\s*"sum":\s*"([0-9a-f]{16})"\s*\}\s*\Z')
# Names that Windows reserves, with any ending.
_DEVICES = frozenset(
    ("CON", "PRN", "AUX", "NUL", *(f"{device}{i}" for device in ("COM", "LPT") for i in "0123456789¹²³"))
)


def file_name(name: str) -> str:
    """Return a name for a file or folder that is safe everywhere: one component, no path, no device.

    Most names of letters, digits and ``_ - .`` stay as they are. Of all others a readable part remains, with
    a hash of the name, so that different names give different files.

    >>> file_name("AT1")
    'AT1'
    >>> file_name("../../etc/x"), file_name("")
    ('etc-x-56da1a2ef2', 'e3b0c44298')
    """
    readable = readable_part(name)
    is_device = readable.partition(".")[0].upper() in _DEVICES
    if readable and readable == name and not is_device and not _LOOKS_HASHED.search(name):
        return name
    digest = sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:_HASH_DIGITS]
    readable = readable.replace(".", "-") if is_device else readable
    return f"{readable}-{digest}" if readable else digest


def readable_part(name: str) -> str:
    """Return what of a name may be part of a file name: letters of any language, digits and ``_ - .``.

    >>> readable_part("Öl druck (2)")
    'Öl-druck-2'
    """
    text = re.sub(r"[^\w.-]+", "-", normalize("NFC", name)).strip("-.")
    return text.encode("utf-8")[:_LONGEST_NAME].decode("utf-8", "ignore").strip("-.")


def write_whole(path: Path, content: str | bytes) -> Path:
    """Write a file atomically and return its path.

    A crash or a full disk leaves either the old file or the complete new one. Missing folders are created;
    the content is on disk when the function returns.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")  # remove_partial knows this form
    try:
        with partial.open("wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except BaseException as error:
        with suppress(OSError):  # the first error says what is wrong
            partial.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno is not None:
            # Writing does not know which file it was, and nobody knows the partial one.
            error.filename = str(path)
        raise
    return path


def remove_partial(folder: Path, names: str) -> None:
    """Remove what processes that were killed within ``write_whole`` have left in a folder.

    Only for a folder in which no other thread of this process writes. What is below the folder stays.
    ``names`` is a regular expression of the whole names of the files that they meant to write.
    """
    form = re.compile(rf"(?:{names})\.([1-9]\d*)\.partial")
    with suppress(OSError):  # what is left takes room and does no harm
        for path in folder.iterdir():
            found = form.fullmatch(path.name)
            if found is None or path.is_symlink() or not path.is_file():
                continue
            pid = int(found[1])
            # Numbers are used again, in containers often at once: an own one is of an earlier process.
            if pid == os.getpid() or not _is_running(pid):
                path.unlink()


def _is_running(pid: int) -> bool:
    """Whether there is a process with this number, of whichever user."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True


def cache_directory() -> Path:
    """Return this tool's directory in the user's cache directory."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "falsifier"


def private_folder(folder: Path) -> Path | None:
    """Make a folder for machine code; None if other users could write to it, or this one cannot."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat()
    except OSError:
        return None
    is_private = found.st_uid == os.getuid() and found.st_mode & 0o022 == 0
    return folder if is_private and os.access(folder, os.W_OK) else None


def below_home(path: str) -> Path:
    """Return a path in which ``~`` is the home of a user; as it is if there is no such user.

    Path.expanduser() fails for those.
    """
    return Path(os.path.expanduser(path))  # noqa: PTH111


def absent(path: Path) -> str:
    """Say that there is no file to read: nothing at all, or a folder."""
    if path.is_dir():
        return f"{path} is a folder"
    # As \f and \n of a Windows path within the double quotes of TOML.
    if any(c in str(path) for c in "\n\t\f\b\r"):
        return f"{str(path)!r}: no such file; write backslashes of a path in single quotes"
    return f"{path}: no such file"


def seen_from_here(path: Path) -> str:
    """Return a path as the user sees it: relative to the current folder if it is below."""
    short = os.path.relpath(path)
    return str(path) if short.startswith("..") else short


def bundled(folder: str) -> Path:
    """Return the folder ``specs`` or ``fmus``: bundled with the package, or next to it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / folder
    return inside if inside.is_dir() else package.parent / folder


def checksum(content: bytes) -> str:
    """Return the checksum of a content: the first 16 digits of its SHA-256."""
    return sha256(content).hexdigest()[:_CHECKSUM_DIGITS]


def seal(text: str) -> str:
    r"""Add a checksum to the text of a JSON object that is not empty.

    >>> seal('{"a":1}')
    '{"a":1,"sum":"8b0f0d75aabe01bb"}\n'
    """
    body = text.rstrip().removesuffix("}").rstrip()
    separator = ",\n  " if "\n" in body else ","
    colon, end = (": ", "\n}") if "\n" in body else (":", "}")
    return f'{body}{separator}"sum"{colon}"{checksum(body.encode())}"{end}\n'


def check_seal(content: bytes) -> None:
    """Check the checksum of a sealed JSON object; ValueError if it has none, or another content."""
    found = _SEAL.search(content[-100:])
    if found is None:
        raise ValueError("it does not end with a checksum")
    body = content[: found.start() - len(content[-100:])]
    if checksum(body) != found[1].decode():
        raise ValueError("its checksum does not match")
