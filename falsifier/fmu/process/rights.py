"""What FMUs may do: what users allow and deny, what that means on this machine, and what was refused."""

import os
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from shlex import quote

from falsifier.core.files import below_home
from falsifier.core.literals import printable
from falsifier.core.words import first_few, listed
from falsifier.errors import SpecError, did_you_mean, written

# Letters and bits of worker/platform/sandbox.h.
_WRITABLE, _READABLE, _HIDDEN, _PROGRAMS, _NETWORK, _WINE, _MEMORY, _COMMAND = b"WRHPNIMC"
_FILES, _PROCESSES, _SYSTEM_CALLS, _REFUSALS = 1, 2, 4, 8

_PROGRAMS_WORD, _NETWORK_WORD = "programs", "network"
_PATHS = ("write", "read")

# What holds keys and passwords in a home folder, and what talks to those who hold them.
_IN_HOME = """
.ssh .gnupg .netrc .config .aws .azure .kube .docker .gsutil .boto .s3cfg .oci .databrickscfg .kaggle .env
.git-credentials .pypirc .npmrc .yarnrc .yarnrc.yml .condarc .wgetrc .curlrc .pgpass .my.cnf .smbcredentials
.vault-token .terraformrc .terraform.d .m2/settings.xml .m2/settings-security.xml .gradle/gradle.properties
.cargo/credentials .cargo/credentials.toml .gem/credentials .composer/auth.json .nuget/NuGet .huggingface
.cache/huggingface/token .cache/huggingface/stored_tokens .password-store .local/share/keyrings
.local/share/kwalletd .local/share/python_keyring .claude .claude.json .codex .gemini .openai .anthropic
.continue .cursor .vscode .vscode-server .jupyter .mozilla .thunderbird .pki .var/app snap .dbus .Xauthority
.ICEauthority .vnc .bitcoin .electrum .bash_history .zsh_history .python_history .sh_history .psql_history
.mysql_history .lesshst .viminfo Library/Keychains
"""
# Variables that name such files and folders.
_NAMED = """
XDG_CONFIG_HOME GNUPGHOME NETRC AWS_SHARED_CREDENTIALS_FILE AWS_CONFIG_FILE KUBECONFIG XAUTHORITY BOTO_CONFIG
GOOGLE_APPLICATION_CREDENTIALS CLOUDSDK_CONFIG AZURE_CONFIG_DIR DOCKER_CONFIG PIP_CONFIG_FILE HF_TOKEN_PATH
NPM_CONFIG_USERCONFIG PGPASSFILE XDG_RUNTIME_DIR
"""
# Devices, sockets and keys of the machine.
_OF_MACHINE = "/dev /run/user /run/secrets /run/credentials /var/run/secrets"
# What nobody else could read.
_OF_ROOT = """
/etc/shadow /etc/shadow- /etc/gshadow /etc/gshadow- /etc/ssh /etc/ssl/private /etc/krb5.keytab /etc/kubernetes
/etc/rancher /etc/NetworkManager/system-connections /var/lib/kubelet
"""

# The refusals that an error tells.
_SHOWN_REFUSALS = 3


@dataclass(frozen=True, slots=True)
class Rights:
    """What an FMU may do beyond reading files and changing those of its own folders."""

    writable: tuple[Path, ...] = ()  # files and folders that it may change and read, with all below
    readable: tuple[Path, ...] = ()  # files and folders that it may read although they may hold keys
    programs: bool = False  # whether it may execute programs
    network: bool = True  # whether it may open connections

    @classmethod
    def of(cls, allow: Collection[str] = (), deny: Collection[str] = ()) -> "Rights":
        """Return the rights by what a user allows and denies.

        Args:
            allow: ``write:PATH``, ``read:PATH``, ``programs``; paths are absolute or begin in this folder.
            deny: ``network``.

        Raises:
            SpecError: naming what is not one of these, or a path that does not exist.
        """
        paths: dict[str, list[Path]] = {kind: [] for kind in _PATHS}
        for word in allow:
            kind, path = _kind_and_path(word)
            if path is not None:
                if not path.exists():
                    raise SpecError(f"{word}: there is no such file or folder; create it first", key="allow")
                paths[kind].append(path.resolve())
            elif word != _PROGRAMS_WORD:
                near = did_you_mean(word, ("write:PATH", "read:PATH", _PROGRAMS_WORD))
                raise SpecError(f"unknown {word!r}; {near}", key="allow")
        for word in deny:
            if word != _NETWORK_WORD:
                raise SpecError(f"unknown {word!r}; {did_you_mean(word, (_NETWORK_WORD,))}", key="deny")
        programs, network = _PROGRAMS_WORD in allow, _NETWORK_WORD not in deny
        return cls(tuple(paths["write"]), tuple(paths["read"]), programs, network)


def resolved(allow: Iterable[str], folder: Path) -> tuple[str, ...]:
    """Return what is allowed with absolute paths; others begin in this folder, ``~`` is the home.

    >>> resolved(["programs", "write:/data/logs"], Path("/spec"))
    ('programs', 'write:/data/logs')
    """
    return with_paths(allow, lambda path: str((folder / path).absolute()))


def with_paths(allow: Iterable[str], change: Callable[[Path], str]) -> tuple[str, ...]:
    """Return what is allowed with other paths."""
    parts = ((word, *_kind_and_path(word)) for word in allow)
    return tuple(word if path is None else f"{kind}:{change(path)}" for word, kind, path in parts)


def _advice(word: str) -> str:
    return f"allow it with {written(f'`--allow {quote(word)}`', f'allow=[{word!r}]')}"


def _kind_and_path(word: str) -> tuple[str, Path | None]:
    """Split what is allowed with a path; None for all else."""
    kind, _, path = word.partition(":")
    return kind, below_home(path.strip()) if kind in _PATHS and path.strip() else None


def hidden_places(environment: Mapping[str, str], homes: Sequence[Path], *, is_root: bool) -> tuple[str, ...]:
    """Return what no FMU may read, whether it exists or not: in homes, of the machine, named by variables."""
    places = [Path(place) for place in (_OF_MACHINE + (_OF_ROOT if is_root else "")).split()]
    places += [home / name for home in homes for name in _IN_HOME.split()]
    places += [
        Path(part) for name in _NAMED.split() for part in environment.get(name, "").split(os.pathsep) if part
    ]
    # Both by the path that is known and by the one that it stands for.
    found = {os.path.normpath(place) for place in places if place.is_absolute()}
    found |= {os.path.realpath(place) for place in places if place.is_absolute()}
    return tuple(sorted(found - {"/", *map(os.path.realpath, homes)}))


def encoded(
    rights: Rights,
    folders: Sequence[Path],
    hidden: Sequence[str],
    *,
    memory: int,
    command: Sequence[str] = (),
) -> bytes:
    """Return what the guard of a worker is told; see worker/platform/guard.c.

    ``folders`` are the FMU's own, the working folder first, and ``hidden`` what it may not read. Its
    processes may use ``memory`` bytes together; 0: no limit. The process becomes the program ``command``,
    which is Wine; empty: the worker itself.
    """
    own = [str(path) for path in (*map(Path.resolve, folders), *rights.writable)]
    parts = [bytes([_WRITABLE]) + os.fsencode(path) for path in own]
    parts += [bytes([_READABLE]) + os.fsencode(path.resolve()) for path in rights.readable]
    parts += [bytes([_HIDDEN]) + os.fsencode(path) for path in hidden]
    parts += [bytes([_COMMAND]) + os.fsencode(word) for word in command]
    parts += [bytes([_PROGRAMS])] * (rights.programs or bool(command))
    parts += [bytes([_NETWORK])] * rights.network + [bytes([_WINE])] * bool(command)
    parts.append(bytes([_MEMORY]) + str(memory).encode())
    text = b"".join(part + b"\0" for part in parts)
    return len(text).to_bytes(4, "little") + text


@dataclass(frozen=True, slots=True)
class Told:
    """What the guard of a worker has told."""

    cause: str = ""  # what ended the process, empty if the guard does not know
    refusals: str = ""  # what was refused before, and how it can be allowed; empty if nothing
    enforced: int = 0  # what is enforced, as bits of ``enum enforced`` in worker/platform/sandbox.h


def read_told(data: bytes) -> Told:
    """Return what a guard's bytes say; they contain names that an FMU has chosen."""
    causes, refused, enforced = [], [], 0
    for part in dict.fromkeys(data.split(b"\0")):
        kind, path = part[:1], printable(os.fsdecode(part[1:]).encode("utf-8", "replace").decode())
        match kind:
            case b"r":
                causes.append(f"the FMU replaced its program by {path}")
            case b"m":
                causes.append("the FMU used more memory than it may")
            case b"e":
                enforced = ord(part[1:2] or b"0") - ord("0")
            case b"w":
                is_folder = os.path.isdir(path)  # noqa: PTH112 (Path.is_dir fails where nothing may be read)
                advice = _advice(f"write:{path if is_folder else Path(path).parent}")
                refused.append(f"tried to change {path}, which was refused; {advice}")
            case b"x":
                refused.append(f"tried to execute {path}, which was refused; {_advice(_PROGRAMS_WORD)}")
            case b"s":
                refused.append("tried to signal another process, which was refused")
            case b"p":
                refused.append("tried to change the settings of another process, which was refused")
            case b"f":
                refused.append(f"tried to start more than {path}")
    shown = first_few(refused, _SHOWN_REFUSALS, between="; it ")
    return Told("; ".join(causes), f"the FMU {shown}" if shown else "", enforced)


def described(rights: Rights, enforced: int) -> str:
    """Say in one line what FMUs may do where this is enforced: bits of ``enum enforced`` in sandbox.h."""
    places = "".join(f" and {path}" for path in rights.writable)
    connecting, executing = "open network connections", "execute programs"
    may = [f"change files in its own folders{places}"]
    may += [f"read {' and '.join(map(str, rights.readable))}"] if rights.readable else []
    may += [connecting] * rights.network + [executing] * rights.programs
    # What it may not do, and which of these bits keep it from that.
    other = "other " if rights.writable or rights.readable else ""
    may_not = [("change other files", _FILES), (f"read {other}known places of keys", _FILES)]
    may_not += [] if rights.programs else [(executing, _FILES | _SYSTEM_CALLS)]
    may_not += [] if rights.network else [(connecting, _SYSTEM_CALLS)]
    may_not += [("reach other processes", _PROCESSES), ("change their settings", _SYSTEM_CALLS)]
    *barred, last = (what for what, _ in may_not)
    text = f"the FMU may {listed(may)}; it may not {', '.join(barred)} or {last}"
    lacking = [what for what, bits in may_not if not enforced & bits]
    if not lacking:
        return text
    only = ", except against mistakes" if enforced & _REFUSALS and not enforced & _FILES else ""
    return f"{text}; of that, this system does not enforce: {', '.join(lacking)}{only}"
