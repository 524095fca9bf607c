"""What falsifier needs from the operating system: the one way to it for all other modules.

``posix`` and ``posix_files`` serve Linux and macOS, ``windows`` and ``windows_files`` Windows.
Each function does as much as the system offers, and does nothing, or says so, where it offers nothing.
"""

import sys

if sys.platform == "win32":
    from falsifier.core import windows as _system
    from falsifier.core import windows_files as _files
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
