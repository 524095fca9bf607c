"""A second confinement for tests of hostile FMUs: only one folder can be changed."""

import ctypes
import os
import struct
from pathlib import Path

# System calls and constants of Landlock, the same on all architectures (linux/landlock.h).
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_WRITE_FILE, _CHANGE_FOLDERS, _REFER, _TRUNCATE = 1 << 1, 0x1FF << 4, 1 << 13, 1 << 14
_NO_NEW_PRIVILEGES, _SET_SECCOMP, _OPEN_PATH = 38, 22, 0o10000000


def version() -> int:
    """Return the version of this system's Landlock, 0 if it has none."""
    found = ctypes.CDLL(None).syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), 1)
    return max(0, int(found))


def without(number: int, error: int, bits: int = 0) -> None:
    """Let this process and what it starts live on a system without a system call, for good.

    It returns the error; with ``bits``, only if its second argument has one of these.
    """
    # Load the number; if it is this one, load the argument; if it has the bits, return the error.
    steps = [(0x20, 0, 0, 0), (0x15, 0, 3, number), (0x20, 0, 0, 24), (0x45, 0, 1, bits)]
    steps = [(0x20, 0, 0, 0), (0x15, 0, 1, number)] if not bits else steps
    steps += [(0x06, 0, 0, 0x50000 | error), (0x06, 0, 0, 0x7FFF0000)]
    code = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in steps))
    program = ctypes.create_string_buffer(struct.pack("@HP", len(steps), ctypes.addressof(code)))
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(_NO_NEW_PRIVILEGES, *map(ctypes.c_ulong, (1, 0, 0, 0)))
    if libc.prctl(_SET_SECCOMP, ctypes.c_ulong(2), program, ctypes.c_ulong(0), ctypes.c_ulong(0)):
        raise OSError(ctypes.get_errno(), "no filter of system calls")


def enter(folder: Path) -> None:
    """Let this process and what it starts change nothing outside a folder, for good.

    Raises:
        OSError: if the system cannot do it; nothing hostile may be started then.
    """
    changes = _WRITE_FILE | _CHANGE_FOLDERS | (_REFER if version() >= 2 else 0)
    changes |= _TRUNCATE if version() >= 3 else 0
    libc = ctypes.CDLL(None, use_errno=True)
    attributes = struct.pack("=Q", changes)
    rules = libc.syscall(_CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), 0)
    if rules < 0 or not changes & _TRUNCATE:
        raise OSError("no Landlock that confines hostile tests")
    for path, allowed in ((folder, changes), (Path("/dev/null"), _WRITE_FILE)):
        place = os.open(path, _OPEN_PATH | os.O_CLOEXEC)
        if libc.syscall(_ADD_RULE, rules, 1, struct.pack("=Qi", allowed, place), 0):
            raise OSError(ctypes.get_errno(), f"{path} cannot be allowed")
        os.close(place)
    libc.prctl(_NO_NEW_PRIVILEGES, *map(ctypes.c_ulong, (1, 0, 0, 0)))
    if libc.syscall(_RESTRICT_SELF, rules, 0):
        raise OSError(ctypes.get_errno(), "Landlock refuses to confine hostile tests")
    os.close(rules)
