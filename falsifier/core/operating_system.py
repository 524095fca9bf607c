"""What falsifier needs from the operating system: the one way to it for all other modules.

``posix`` and ``posix_files`` serve Linux and macOS, ``windows`` Windows.
Each function does as much as the system offers, and does nothing, or says so, where it offers nothing.
"""

import sys

from falsifier.errors import MachineError

if sys.platform == "win32":
    from falsifier.core import windows as _files
    from falsifier.core import windows as _system
else:
    from falsifier.core import posix as _system
    from falsifier.core import posix_files as _files

Program = _system.Program
can_confine = _system.can_confine
exit_text = _system.exit_text
hide_memory = _system.hide_memory
is_running = _system.is_running
machine_memory = _system.machine_memory
memory_limits = _system.memory_limits
on_fork = _system.on_fork
start_silent_tracker = _system.start_silent_tracker
yield_processor = _system.yield_processor

can_seal = _files.can_seal
forbids_programs = _files.forbids_programs
homes = _files.homes
is_own = _files.is_own
is_private = _files.is_private
is_root = _files.is_root
lock_file = _files.lock_file
read_at = _files.read_at
remove_tree = _files.remove_tree
replace = _files.replace
sealed_file = _files.sealed_file
user = _files.user
write_at = _files.write_at

# Below these, libraries of linear algebra end the process, with exit code 1, or wait for ever.
_LEAST = {"d": 300 << 20, "v": 500 << 20}


def check_memory_limits() -> None:
    """Check that a process may use as much memory as its libraries need.

    Raises:
        MachineError: if it may not; names the limit and how to raise it.
    """
    for option, allowed in memory_limits().items():
        least = _LEAST[option]
        if allowed < least:
            raise MachineError(
                f"processes may use {allowed >> 20} MiB of memory (ulimit -{option}); simulations need at "
                f"least {least >> 20} MiB: raise it with ulimit -{option} {least >> 10}"
            )
